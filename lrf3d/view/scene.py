"""The data of a world for the page before anything moves, in the world's local frame."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely

from lrf3d.geometry import Bool, Float, Int
from lrf3d.gltf import still_glb
from lrf3d.gltf.scan_mesh import REACH
from lrf3d.laser import LaserRangeFinder
from lrf3d.mapping import LineMap
from lrf3d.render.movers import mover_colours
from lrf3d.render.palette import object_tints
from lrf3d.render.structures import Structures
from lrf3d.world import World

if TYPE_CHECKING:
    from lrf3d.casting.mover import Mover

_LEAST_SIZE = 6.0
"""Size [m] that cameras take a world for at the least."""


@dataclass(frozen=True, eq=False)
class Scene:
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
    movers: "tuple[Mover, ...]" = (),
) -> Scene:
    """The scene of a world, with where the robot goes (k, 2) [m], and what moves beside it."""
    structures = Structures.from_world(world, path)
    places = np.concatenate([structures.segments.reshape(-1, 2), path - structures.origin])
    low, high = places.min(axis=0), places.max(axis=0)
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
        "movers": [
            {
                "outline": mover.outline.ravel().tolist(),
                "colour": np.round(255.0 * colour).astype(int).tolist(),
            }
            for mover, colour in zip(movers, mover_colours(movers), strict=True)
        ],
        "laser": {
            "angles": lrf.angles.tolist(),
            "rangeMax": lrf.range_max,
            "height": lrf.height,
            "reach": min(lrf.range_max, REACH),
        },
    }
    return Scene(setup, still_glb(world.name, structures, lrf.height, movers))


def joined_beams(ranges: Float, walls: Int) -> Bool:
    """Whether each beam (…, beams − 1) and the next ended on one wall."""
    hits = np.isfinite(ranges)
    same = (walls[..., 1:] == walls[..., :-1]) & (walls[..., 1:] >= 0)
    return np.asarray(hits[..., 1:] & hits[..., :-1] & same)


def map_arrays(line_map: LineMap, objects: Int, origin: Float) -> tuple[Float, Int]:
    """Segments (m, 4) of a map in the local frame [m], and their colours (m, 3) in 0…255.

    Those are the colours of their objects (m,), by numbers that last while the map grows.
    """
    segments = line_map.segments - np.tile(origin, 2)
    return segments, np.round(255.0 * object_tints(objects)).astype(np.int64)


def _outlines(structures: Structures) -> list[list[float]]:
    """Outlines of houses and their yards: x, y, x, y, … each."""
    rings = shapely.get_rings(structures.solids)
    return [np.round(shapely.get_coordinates(ring), 2).ravel().tolist() for ring in rings]
