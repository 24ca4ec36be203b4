"""A run as glTF: the robot drives, and its scans and map snapshots follow each other.

Every player of glTF can move, turn and scale nodes, and few can do more. So each scan and each
stage of the map is a node of its own, which has its size while it is to be seen and none
otherwise, and each straight piece of the trail is one that grows while it is driven.
"""

from collections.abc import Iterator
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from lrf3d.errors import InputError
from lrf3d.geometry import Float, Int, Single, quad_indices
from lrf3d.gltf.bodies import add_chase_camera, add_movers, add_robot, drive_movers
from lrf3d.gltf.document import INDICES, KEYS, VERTICES, Document, linear
from lrf3d.gltf.scan_mesh import ScanMeshes
from lrf3d.gltf.stage import add_stage, new_document
from lrf3d.mapping import LineMap
from lrf3d.run import Run
from lrf3d.scene import look
from lrf3d.scene.structures import Structures
from lrf3d.scene.timeline import Timeline, jumps, key_times, scan_times

if TYPE_CHECKING:
    from lrf3d.casting.dynamic_obstacle import DynamicObstacle


_TRAIL_ERROR = 0.03
"""How far a straight piece of the trail may be off [m], in place and along the way."""


def run_glb(run: Run, *, every: int = 1) -> bytes:
    """A run as a GLB file with one animation.

    Args:
        run: The run.
        every: Each scan of this many is kept, for smaller files of long runs.

    Raises:
        InputError: ``every`` is less than 1.
    """
    if every < 1:
        raise InputError(f"every {every}: expected a whole number from 1")
    # A scene plays as fast as the robot drove.
    timeline = Timeline(run, playback=1.0)
    structures = Structures.from_run(run)
    document = new_document(run.world.name, structures)
    add_stage(document, structures)
    _add_robot(document, timeline, structures)
    drive_movers(document, timeline)
    _add_scans(document, timeline, every)
    _add_maps(document, timeline)
    _add_trail(document, timeline)
    return document.glb()


def still_glb(
    name: str,
    structures: Structures,
    laser_height: float,
    movers: "tuple[DynamicObstacle, ...]" = (),
) -> bytes:
    """A world as a GLB file, with the robot and dynamic obstacles, all at the frame's origin."""
    document = new_document(name, structures)
    add_stage(document, structures)
    add_robot(document, laser_height)
    add_movers(document, movers)
    return document.glb()


class _Showing:
    """Shows nodes for a while of the animation by giving them a size."""

    def __init__(self, document: Document, start: float, end: float) -> None:
        self._document, self._start, self._end = document, start, end
        self._sizes: dict[tuple[int, ...], int] = {}

    def between(self, node: int, begin: float, end: float) -> None:
        """Show a node from one time to another [s]; all the time if that is all there is."""
        first, last = begin <= self._start, end >= self._end
        if first and last:
            return
        if not first:
            # Programs that play nothing show the start.
            self._document.gltf.nodes[node].scale = [0.0, 0.0, 0.0]
        sizes = (*([] if first else [0]), 1, *([] if last else [0]))
        if sizes not in self._sizes:
            values = np.repeat(np.array(sizes, np.float32)[:, None], 3, axis=1)
            self._sizes[sizes] = self._document.array(values, KEYS)
        times = [self._start, *([] if first else [begin]), *([] if last else [end])]
        keys = np.array(times) - self._start
        inputs = self._document.array(keys.astype(np.float32), KEYS, bounded=True)
        self._document.animate(node, "scale", inputs, self._sizes[sizes], step=True)


def _add_robot(document: Document, timeline: Timeline, structures: Structures) -> None:
    """The robot, which drives, and a camera that looks over its shoulder."""
    times = key_times(timeline)
    poses = timeline.poses(times) - [*timeline.origin, 0.0]
    headings = 0.5 * np.unwrap(poses[:, 2])
    places = np.column_stack([poses[:, :2], np.zeros(len(poses))]).astype(np.float32)
    turns = np.zeros((len(poses), 4), np.float32)
    turns[:, 2], turns[:, 3] = np.sin(headings), np.cos(headings)
    robot = add_robot(document, timeline.run.lrf.height)
    node = document.gltf.nodes[robot]
    node.translation, node.rotation = places[0].tolist(), turns[0].tolist()
    if len(times) > 1:
        keys = document.array((times - times[0]).astype(np.float32), KEYS, bounded=True)
        document.animate(robot, "translation", keys, document.array(places, KEYS))
        document.animate(robot, "rotation", keys, document.array(turns, KEYS))
    add_chase_camera(document, robot, structures)


def _add_scans(document: Document, timeline: Timeline, every: int) -> None:
    """The beams of each scan, seen while it is the nearest in time."""
    run = timeline.run
    begins, ends = scan_times(timeline, every)
    meshes = ScanMeshes(document, timeline)
    showing = _Showing(document, timeline.start, timeline.end)
    group = document.node("beams", document.root)
    scans = range(0, len(run), every)
    for scan, begin, end in zip(scans, begins.tolist(), ends.tolist(), strict=True):
        mesh, place = meshes.add(scan)
        node = document.node(f"scan {scan}", group, mesh=mesh, translation=place)
        showing.between(node, begin, end)


def _add_maps(document: Document, timeline: Timeline) -> None:
    """Each map snapshot as bands along the walls, each object in its colour."""
    run = timeline.run
    material = document.glowing("map")
    showing = _Showing(document, timeline.start, timeline.end)
    group = document.node("map", document.root)
    begins = run.trajectory.times[list(run.snapshot_scans)].tolist()
    times = pairwise([*begins, timeline.end])
    for stage, objects, (begin, end) in zip(run.maps, run.lasting_objects, times, strict=True):
        if not len(stage):
            continue
        positions, colours = _bands(stage, objects, timeline.origin)
        attributes = {
            "POSITION": document.array(positions, VERTICES, bounded=True),
            "COLOR_0": document.array(colours, VERTICES, normalised=True),
        }
        indices = document.array(quad_indices(len(positions) // 4), INDICES)
        mesh = document.mesh("map", [document.part(material, attributes, indices)])
        node = document.node(f"map of {len(stage)} segments", group, mesh=mesh)
        showing.between(node, begin, end)


def _bands(stage: LineMap, objects: Int, origin: Float) -> tuple[Single, NDArray[np.uint8]]:
    """Corners (12 · m, 3) of both sides and the top of each segment, and colours (12 · m, 4)."""
    ends = (stage.segments - np.tile(origin, 2)).reshape(-1, 2, 2)
    along = ends[:, 1] - ends[:, 0]
    along /= np.maximum(np.hypot(along[:, 0], along[:, 1]), 1e-9)[:, None]
    side = 0.5 * look.MAP_WIDTH * np.column_stack([-along[:, 1], along[:, 0]])
    (start, end), (low, high) = (ends[:, 0], ends[:, 1]), look.MAP_BAND
    positions = np.zeros((len(ends), 3, 4, 3), np.float32)
    for face, corners in enumerate(
        [
            ((start + side, low), (end + side, low), (end + side, high), (start + side, high)),
            ((end - side, low), (start - side, low), (start - side, high), (end - side, high)),
            ((start - side, high), (end - side, high), (end + side, high), (start + side, high)),
        ]
    ):
        for corner, (place, height) in enumerate(corners):
            positions[:, face, corner, :2], positions[:, face, corner, 2] = place, height
    colours = np.full((len(ends), 4), 255, np.uint8)
    colours[:, :3] = np.round(255.0 * linear(look.object_tints(objects)))
    return positions.reshape(-1, 3), np.repeat(colours, 12, axis=0)


def _add_trail(document: Document, timeline: Timeline) -> None:
    """The way that was driven, as straight pieces that grow with the robot."""
    times = key_times(timeline)
    places = timeline.poses(times)[:, :2] - timeline.origin
    material = document.glowing(
        "trail", colour=linear(np.array(look.TRAIL_COLOUR)).astype(np.float64)
    )
    half = 0.5 * look.TRAIL_WIDTH
    strip = np.array([[0, -half, 0], [1, -half, 0], [1, half, 0], [0, half, 0]], np.float32)
    attributes = {"POSITION": document.array(strip, VERTICES, bounded=True)}
    part = document.part(material, attributes, document.array(quad_indices(1), INDICES))
    mesh = document.mesh("trail", [part])
    group = document.node("trail", document.root)
    set_down = jumps(times)
    for first, last in _straight_pieces(times, places):
        way = places[last] - places[first]
        length = float(np.hypot(*way))
        begin, end = float(times[first] - times[0]), float(times[last] - times[0])
        if length < 1e-3 or set_down[first:last].any():
            continue
        half_turn = 0.5 * float(np.arctan2(way[1], way[0]))
        node = document.node(
            f"trail from {begin:.1f} s",
            group,
            mesh=mesh,
            translation=[*places[first].tolist(), look.TRAIL_HEIGHT],
            rotation=[0.0, 0.0, float(np.sin(half_turn)), float(np.cos(half_turn))],
            scale=[0.0, 0.0, 0.0],
        )
        keys = document.array(np.array([begin, end], np.float32), KEYS, bounded=True)
        # Its width is there at once: a strip that widens as it grows would be a wedge.
        grown = np.array([[0, 1, 1], [length, 1, 1]], np.float32)
        document.animate(node, "scale", keys, document.array(grown, KEYS))


def _straight_pieces(times: Float, places: Float) -> Iterator[tuple[int, int]]:
    """First and last key of each piece that is straight and driven evenly."""
    first = 0
    while first < len(times) - 1:
        last = first + 1
        while last + 1 < len(times) and _is_straight(times, places, first, last + 1):
            last += 1
        yield first, last
        first = last


def _is_straight(times: Float, places: Float, first: int, last: int) -> bool:
    share = (times[first : last + 1] - times[first]) / (times[last] - times[first])
    even = places[first] + share[:, None] * (places[last] - places[first])
    return bool(np.abs(places[first : last + 1] - even).max() < _TRAIL_ERROR)
