"""The data of the page, in the world's local frame: a world before anything moves, and a run.

A run is one block of plain arrays, and where each stands in it.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely
from numpy.typing import NDArray

from lrf3d.geometry import Bool, Float, Int
from lrf3d.gltf import still_glb
from lrf3d.laser import LaserRangeFinder
from lrf3d.run import Run
from lrf3d.scene import look
from lrf3d.scene.beams import beam_reach, darkness, fading_ends
from lrf3d.scene.bodies import obstacle_colours, robot_body
from lrf3d.scene.estimate import BELIEVED, CORNERS, TRUTH, DrawnEstimate
from lrf3d.scene.map_bands import WallTops
from lrf3d.scene.obstacles import Obstacles
from lrf3d.scene.shapes import Body
from lrf3d.scene.stage import paint_stage
from lrf3d.scene.structures import Structures
from lrf3d.scene.timeline import Timeline, drive_keys, obstacle_keys, scan_times
from lrf3d.scene.trail_and_map import DrawnMap, smoothed
from lrf3d.scene.turns import WallOptics
from lrf3d.world import World

if TYPE_CHECKING:
    from lrf3d.casting.dynamic_obstacle import DynamicObstacle


_LEAST_SIZE = 6.0
"""Size [m] that cameras take a world for at the least."""


@dataclass(frozen=True, eq=False)
class PageScene:
    """A page's scene.

    Args:
        setup: The data for the page, as plain values for JSON.
        glb: The world and the robot as a GLB file.
    """

    setup: dict[str, Any]
    glb: bytes


def make_scene(
    world: World,
    lrf: LaserRangeFinder,
    path: Float,
    *,
    title: str,
    obstacles: "tuple[DynamicObstacle, ...]" = (),
) -> PageScene:
    """The scene of a world, with where the robot goes (k, 2) [m], and what moves beside it."""
    structures = Structures.from_world(world, path)
    places = np.concatenate([structures.segments.reshape(-1, 2), path - structures.origin])
    low, high = places.min(axis=0), places.max(axis=0)
    step = float(lrf.angles[1] - lrf.angles[0]) if lrf.beams > 1 else 0.0
    walls = np.column_stack([structures.segments, structures.heights])
    setup = {
        "title": title,
        "indoor": structures.indoor,
        "origin": structures.origin.tolist(),
        "low": low.tolist(),
        "high": high.tolist(),
        "middle": (0.5 * (low + high)).tolist(),
        "size": max(_LEAST_SIZE, float((high - low).max())),
        "roof": float(structures.heights.max(initial=0.0)),
        "walls": np.round(walls, 3).ravel().tolist(),
        "houses": _outlines(structures),
        "mirrors": _mirrors(world, structures),
        "obstacles": [
            {
                "outline": obstacle.outline.ravel().tolist(),
                "colour": np.round(255.0 * colour).astype(int).tolist(),
            }
            for obstacle, colour in zip(obstacles, obstacle_colours(obstacles), strict=True)
        ],
        "laser": {
            "angles": lrf.angles.tolist(),
            "rangeMax": lrf.range_max,
            "height": lrf.height,
            "reach": beam_reach(lrf.range_max, structures),
        },
        "look": page_look(structures.indoor, fading_ends(lrf.beams, step)),
    }
    pose = np.eye(4)
    bodies = [("robot", Body(robot_body(lrf.height), pose))]
    bodies += Obstacles(obstacles, structures.origin, indoor=structures.indoor).bodies(0.0)
    return PageScene(setup, still_glb(world.name, paint_stage(structures), bodies))


def page_look(indoor: bool, shares: Float) -> dict[str, Any]:
    """The constants of the look that the page draws with; colours are lists of 0…1.

    Shares (beams,) are what of the opacity of each beam is left towards the ends of the fan.
    """
    strength = look.FAN_STRENGTH_INDOOR if indoor else look.FAN_STRENGTH
    beams = {"drawn": look.BEAMS_DRAWN, "colour": look.BEAM_COLOUR, "strength": look.BEAM_STRENGTH}
    beams = {**beams, "curve": 1.0, "turned": look.TURNED_SHARE}
    return {
        "haze": look.HAZE_INDOOR if indoor else look.HAZE,
        "zenith": look.ZENITH_INDOOR if indoor else look.ZENITH,
        "shadow": look.SHADOW_COLOUR,
        "beams": beams,
        "fan": {
            "colour": look.FAN_COLOUR,
            "strength": strength,
            "ahead": look.FAN_SHARE_AHEAD,
            "curve": look.FAN_CURVE,
            "shares": np.round(shares, 3).tolist(),
        },
        "points": {
            "colours": look.RANGE_COLOURS.tolist(),
            "farthest": look.FARTHEST_COLOUR,
            "sizes": [look.POINT_SIZE, *look.POINT_PIXELS],
        },
        "trace": {
            "colour": look.TRACE_COLOUR,
            "half": 0.5 * look.TRACE_HEIGHT,
            "gap": look.TRACE_GAP,
        },
        "trail": {
            "colour": look.TRAIL_COLOUR,
            "width": look.TRAIL_WIDTH,
            "height": look.TRAIL_HEIGHT,
        },
        "estimate": {
            "colour": look.ESTIMATE_COLOUR,
            "faded": look.ESTIMATE_FADED,
            "width": look.ESTIMATE_WIDTH,
            "height": look.TRAIL_HEIGHT + look.ESTIMATE_LIFT,
            "corners": CORNERS,
        },
        "map": {"band": look.MAP_BAND, "width": look.MAP_WIDTH},
        "robot": {"colour": look.ROBOT, "rim": look.ROBOT_RIM, "dart": look.DART.tolist()},
        "inset": {
            "paper": look.PAPER,
            "stone": look.STONE,
            "whole": look.INSET_WHOLE,
            "followed": look.INSET_FOLLOWED,
        },
    }


def joined_beams(ranges: Float, walls: Int) -> Bool:
    """Whether each beam (…, beams − 1) and the next ended on one wall."""
    hits = np.isfinite(ranges)
    same = (walls[..., 1:] == walls[..., :-1]) & (walls[..., 1:] >= 0)
    return np.asarray(hits[..., 1:] & hits[..., :-1] & same)


def _mirrors(world: World, structures: Structures) -> list[float]:
    """The walls that turn beams: x1, y1, x2, y2, … of each, not rounded as beams go on far."""
    optics = WallOptics.of(world)
    if optics is None:
        return []
    mirrors = world.segments[optics.mirrors] - np.tile(structures.origin, 2)
    return mirrors.ravel().tolist()


def _outlines(structures: Structures) -> list[list[float]]:
    """Outlines of houses and their yards, and of trunks: x, y, x, y, … each."""
    rings = shapely.get_rings(structures.solids)
    return [np.round(shapely.get_coordinates(ring), 2).ravel().tolist() for ring in rings]


_ALIGNMENT = 4
"""Bytes that the start of every array is a multiple of."""


def pack_run(run: Run) -> tuple[bytes, dict[str, Any]]:
    """All that moves in a run, in its world's local frame.

    Returns:
        The arrays one after the other, and their description for the page: type, first byte and
        length of each, the legs of the way that are jumps, and the time that the run starts at.
    """
    # A scene plays as fast as the robot drove.
    timeline = Timeline(run, playback=1.0)
    keys = smoothed(drive_keys(timeline))
    begins, ends = scan_times(timeline)
    # The first of them is empty, so that there is one also where a run has no map.
    maps = [
        DrawnMap.from_snapshot(run, number, timeline.origin) for number in range(-1, len(run.maps))
    ]
    walls = run.world.segments - np.tile(timeline.origin, 2)
    tops = WallTops(walls, run.world.heights)
    stage_times = run.trajectory.times[list(run.snapshot_scans)]
    ways = [obstacle_keys(obstacle, timeline) for obstacle in run.obstacles]
    arrays = {
        "keyTimes": (keys.times, np.float32),
        "keyPoses": (keys.poses, np.float32),
        "begins": (begins - timeline.start, np.float32),
        "ends": (ends - timeline.start, np.float32),
        "poses": (run.trajectory.poses - [*timeline.origin, 0.0], np.float32),
        "ranges": (run.ranges, np.float32),
        "stageTimes": (stage_times - timeline.start, np.float32),
        "stageSizes": ([len(stage) for stage in run.maps], np.int32),
        "stageObjects": ([stage.object_count for stage in run.maps], np.int32),
        "segments": (np.concatenate([drawn.segments for drawn in maps]), np.float32),
        "colours": (np.concatenate([drawn.colour_bytes for drawn in maps]), np.uint8),
        "tops": (np.concatenate([tops.bands(drawn.segments) for drawn in maps]), np.float32),
        "obstacleSizes": ([len(times) for times, _ in ways], np.int32),
        "obstacleTimes": (np.concatenate([*(times for times, _ in ways), []]), np.float32),
        "obstaclePoses": (
            np.concatenate([*(poses for _, poses in ways), np.empty((0, 3))]),
            np.float32,
        ),
        **_estimate_arrays(timeline),
        "joined": (joined_beams(run.ranges, run.walls), np.uint8),
    }
    if run.film.points_by == "intensity" and run.intensities is not None:
        shares = darkness(np.nan_to_num(run.intensities))
        arrays["darkness"] = np.round(255.0 * shares), np.uint8
    block, layout = bytearray(), {}
    for name, (values, kind) in arrays.items():
        array: NDArray[Any] = np.asarray(values, kind).ravel()
        layout[name] = (array.dtype.name, len(block), len(array))
        block += array.tobytes()
        block += bytes(-len(block) % _ALIGNMENT)
    told = {
        "layout": layout,
        "jumps": np.flatnonzero(keys.set_down).tolist(),
        "start": timeline.start,
        "knowsTruth": run.knows_truth,
        "legend": [] if run.estimate is None else [TRUTH, BELIEVED],
    }
    return bytes(block), told


def _estimate_arrays(timeline: Timeline) -> dict[str, tuple[Any, type]]:
    """What a robot believed that was not given its poses, and which of its ellipses stay."""
    estimate = DrawnEstimate.from_timeline(timeline)
    if estimate is None:
        return {}
    return {
        "estimateTimes": (estimate.times, np.float32),
        "estimatePlaces": (estimate.places, np.float32),
        "ellipseTimes": (estimate.ellipse_times, np.float32),
        "ellipseShapes": (estimate.shapes, np.float32),
        "keptEllipses": (estimate.kept, np.int32),
    }
