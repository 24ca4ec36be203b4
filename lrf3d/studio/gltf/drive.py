"""A run as glTF: the robot drives, and its scans and map snapshots follow each other.

Every player of glTF can move, turn and scale nodes, and few can do more. So each scan and each
snapshot of the map is a node of its own, which has its size while it is to be seen and none
otherwise, and each straight piece of the trail is one that grows while it is driven.
"""

import warnings
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from lrf3d.base.errors import Lrf3dNote
from lrf3d.geometry.lines import LEFT, Float, whole_number
from lrf3d.simulation.run import Run
from lrf3d.studio.gltf.document import LINES, Document, turned
from lrf3d.studio.gltf.stage import add_stage
from lrf3d.studio.scene import look
from lrf3d.studio.scene.camera import Look, SmoothPath
from lrf3d.studio.scene.cameras import behind
from lrf3d.studio.scene.glass import Panes
from lrf3d.studio.scene.marks import DrawnEstimate, DrawnMap, outlines
from lrf3d.studio.scene.moments import Scene
from lrf3d.studio.scene.shapes import Lines, Points, Seen, level_lines, together
from lrf3d.studio.scene.timeline import DriveKeys, Timeline, drive_keys, obstacle_keys, scan_times

# A look that nothing is made larger for, to be seen from far away.
_ABOVE = Look(np.array([0.0, 0.0, 1.0]), np.zeros(3), field=1e-6, up=(0.0, 1.0, 0.0))

# Distance of hits from their walls [m], so that both never share a pixel.
_OFF_WALL = 0.02

# Number of points of a lidar's scan: each takes 84 bytes in the file.
_CLOUD_POINTS = 500

# Where the robot's camera looks, ahead of it [m].
_AHEAD = np.array([2.0, 0.0, 0.0])

# Depth of the near plane of that camera [m].
_NEAR = 0.1

# Depth of its far plane [m].
_FAR = 2000.0

# Largest number of scans: with 181 beams they take about 2 MB.
_MOST_SCANS = 80

# Width of a beam at its end [m].
_BEAM_WIDTH = 0.03

# Width of trails [m].
_TRAIL_WIDTH = 0.045

# How far the estimated trail lies over the true one, and its ellipses over that [m].
_LIFT = 0.005

# Largest error of a straight piece of a trail [m].
_PIECE_ERROR = 0.03

# Least length of such a piece, as of a robot that turns on the spot, and least half axis of an
# ellipse [m].
_LEAST = 1e-3

# Opacity of panes of glass.
_PANE = 0.2

# Directions of the corners of the upright triangles of hits [rad].
_CORNERS = np.radians(90.0 + 120.0 * np.arange(3))


def run_glb(run: Run, *, every: int = 1) -> bytes:
    """A run as a GLB file with one animation; of ``every`` scans one is kept, and 80 at most.

    Raises:
        InputError: ``every`` is no whole number from 1.
    """
    every = whole_number(every, "every")
    least = -(-len(run) // _MOST_SCANS)
    if every < least:
        every = least
        warnings.warn(
            f"GLB: of {every} scans one is shown, as {_MOST_SCANS} are the most", Lrf3dNote, 2
        )
    # A scene plays as fast as the robot drove.
    scene = Scene(Timeline(run, playback=1.0))
    timeline = scene.timeline
    about = {"origin": scene.origin.tolist(), "world": run.world.name}
    document = Document(run.world.name or "world", about, timeline.end - timeline.start)
    add_stage(
        document,
        scene.stage,
        DrawnMap.from_snapshot(
            run, len(run.maps) - 1, scene.structures, scene.exposure, scene.team[run]
        ),
    )
    keys = drive_keys(timeline)
    paths = [keys, *(obstacle_keys(each, timeline) for each in run.obstacles)]
    nodes = []
    for (name, body), path in zip(_seen(scene, timeline.start).bodies, paths, strict=True):
        part = document.part(document.material(name), *body.faces, kind=np.uint16)
        nodes.append(document.node(name, document.root, part))
        document.animate(nodes[-1], "translation", path.times, path.poses * [1.0, 1.0, 0.0])
        document.animate(nodes[-1], "rotation", path.times, turned(path.poses[:, 2]))
    _add_camera(document, nodes[0], scene)
    if scene.structures.glass.any():
        panes = Panes.of(scene.structures, np.inf)
        material = document.material("glass", translucent=True)
        corners, colours, _ = panes.faces(np.zeros(3), 0.0)
        # Players do not know from where panes are seen.
        colours[..., 3] = _PANE
        parts = document.part(material, corners, colours), _lines(document, panes.edges, material)
        document.node("glass", document.root, *parts)
    _add_scans(document, scene, every)
    _add_maps(document, scene, run)
    if run.knows_truth:
        _add_trail(document, keys, "trail", look.TRAIL_COLOUR, look.TRAIL_HEIGHT)
    _add_estimate(document, timeline)
    return document.glb()


def _seen(scene: Scene, time: float, *layers: str) -> Seen:
    return scene.seen(scene.timeline.moment(time), _ABOVE, (1280, 720), layers)


def _add_camera(document: Document, robot: int, scene: Scene) -> None:
    """The chase's camera, which the robot carries; in rooms it is over the top of the walls."""
    structures = scene.structures
    path = SmoothPath(np.zeros(1), np.zeros((1, 2)), np.zeros(1))
    view = behind(path, structures.setting.chase).look(0.0)
    over = structures.heights.max(initial=0.0) if structures.indoor else 0.0
    eye = view.eye + np.array([0.0, 0.0, over])
    # The film's picture is moved up instead, which glTF cannot.
    view = replace(view, eye=eye, target=view.target + _AHEAD, up=(0.0, 0.0, 1.0))
    lens = {"yfov": view.field, "znear": _NEAR, "zfar": _FAR, "aspectRatio": 16 / 9}
    camera = document.add("cameras", type="perspective", perspective=lens, name="chase")
    document.node("chase camera", robot, camera=camera, matrix=view.pose.T.ravel().tolist())


def _add_scans(document: Document, scene: Scene, every: int) -> None:
    times = scene.run.trajectory.times[::every]
    shown = np.column_stack(scan_times(scene.timeline, every)) - scene.timeline.start
    group = document.node("beams", document.root)
    fans = []
    points = []
    for number, (time, (begin, end)) in enumerate(zip(times, shown.tolist(), strict=True)):
        marks = dict(_seen(scene, time, "beams", "points").marks)
        hits = marks["points"]
        beams = marks["beams"]
        assert isinstance(hits, Points) and isinstance(beams, Lines)
        cloud = marks.get("clouds")
        if isinstance(cloud, Points):
            step = slice(None, None, 1 + len(cloud.places) // _CLOUD_POINTS)
            few = cloud.places[step], cloud.colours[step], cloud.sides[step]
            hits = together([hits, Points(*few, cloud.size, cloud.pixels)])
        node = document.node(f"scan {number * every}", group)
        document.show(node, begin, end)
        fans.append((node, *_slender(beams)))
        robot = scene.run.trajectory.poses[number * every, :2] - scene.origin
        points.append((node, _triangles(hits, robot), np.repeat(hits.colours[:, None], 3, axis=1)))
    material = document.material("beams", translucent=True)
    document.follow("all beams", material, fans)
    document.follow("all hits", material, points)


def _slender(lines: Lines) -> tuple[Float, Float]:
    """Lines as level triangles (n, 3, 3), which end as wide as a beam, and their colours."""
    along = (lines.ends - lines.starts)[:, :2].astype(np.float64)
    across = along @ LEFT / np.maximum(np.hypot(*along.T), look.TINY)[:, None]
    half = np.insert(0.5 * _BEAM_WIDTH * across, 2, 0.0, axis=1)
    corners = np.stack([lines.starts, lines.ends - half, lines.ends + half], axis=1)
    tints = np.repeat(lines.colours[:, None], 3, axis=1)
    return corners, np.concatenate([tints, lines.opacities[:, [0, 1, 1], None]], axis=2)


def _lines(document: Document, lines: Lines, material: int) -> dict[str, Any]:
    tints = np.repeat(lines.colours[:, None], 2, axis=1)
    tints = np.concatenate([tints, lines.opacities[..., None]], axis=2)
    return document.part(material, np.stack([lines.starts, lines.ends], axis=1), tints, mode=LINES)


def _triangles(hits: Points, robot: Float) -> Float:
    """Upright triangles (n, 3, 3) at hits, which look where their walls do, or at a robot (2,)."""
    loose = (hits.sides == 0.0).all(axis=1, keepdims=True)
    side = np.where(loose, robot - hits.places[:, :2], hits.sides)
    side = side / np.maximum(np.hypot(*side.T), look.TINY)[:, None]
    across = np.insert(side @ LEFT, 2, 0.0, axis=1)[:, None] * np.cos(_CORNERS)[:, None]
    up = np.array([0.0, 0.0, 1.0]) * np.sin(_CORNERS)[:, None]
    places = hits.places + _OFF_WALL * np.insert(side, 2, 0.0, axis=1)
    return np.asarray(places[:, None] + hits.size * (across + up))


def _add_maps(document: Document, scene: Scene, run: Run) -> None:
    timeline = scene.timeline
    material = document.material("map")
    group = document.node("map", document.root)
    drawn = []
    begins = run.trajectory.times[list(run.snapshot_scans)].tolist()
    for stage, (begin, end) in zip(run.maps, pairwise([*begins, timeline.end]), strict=True):
        if not len(stage):
            continue
        bands = dict(_seen(scene, begin, "map").marks)["bands"]
        assert isinstance(bands, Lines)
        half = np.array([0.0, 0.0, 0.5 * bands.thick])
        ends = bands.starts - half, bands.ends - half, bands.ends + half, bands.starts + half
        corners = np.stack(ends, axis=1)[:, [0, 1, 2, 0, 2, 3]]
        node = document.node(f"map of {len(stage)} segments", group)
        document.show(node, begin - timeline.start, end - timeline.start)
        drawn.append((node, corners, np.repeat(bands.colours[:, None], 6, axis=1)))
    document.follow("all maps", material, drawn)


def _add_trail(
    document: Document, keys: DriveKeys, name: str, colour: tuple[float, ...], height: float
) -> None:
    strip = np.array([[0, -0.5, 0], [1, -0.5, 0], [1, 0.5, 0], [0, 0.5, 0]])[[0, 1, 2, 0, 2, 3]]
    drawn = []
    group = document.node(name, document.root)
    pieces = keys.thinned(_PIECE_ERROR)
    for number in np.flatnonzero(pieces.driven):
        (begin, end), (start, stop) = (column[number : number + 2] for column in pieces)
        along = (stop - start)[:2]
        length = np.hypot(*along)
        if length < _LEAST:
            continue
        place = {"translation": [*start[:2].tolist(), height]}
        place["rotation"] = turned(np.arctan2(along[1:], along[:1]))[0].tolist()
        node = document.node(f"{name} from {begin:.1f} s", group, **place)
        drawn.append((node, strip, np.tile(colour, (6, 1))))
        # Its width is there at once: a strip that widens as it grows would be a wedge.
        grown = np.array([[0.0, _TRAIL_WIDTH, 1.0], [length, _TRAIL_WIDTH, 1.0]])
        document.animate(node, "scale", np.array([begin, end]), grown)
    document.follow(f"all of the {name}", document.material(name), drawn)


def _add_estimate(document: Document, timeline: Timeline) -> None:
    """The estimated trail, the ellipses that stay, and that of now: a circle that is stretched."""
    drawn = DrawnEstimate.from_timeline(timeline)
    if drawn is None:
        return
    keys = drawn.keys
    known = drawn.keys.times[drawn.known]
    _add_trail(document, keys, "estimate", look.ESTIMATE_COLOUR, look.TRAIL_HEIGHT + _LIFT)
    if not len(known):
        return
    material = document.material("ellipses", translucent=True)
    group = document.node("ellipses", document.root)
    for outline, begin in zip(drawn.outlines(), known[drawn.kept], strict=True):
        ring = _ring(document, outline, look.ESTIMATE_FADED, material)
        document.show(document.node(f"ellipse from {begin:.1f} s", group, ring), float(begin))
    circle = outlines(np.zeros((1, 2)), np.eye(2)[None])[0]
    node = document.node("ellipse of now", document.root, _ring(document, circle, 1.0, material))
    sizes, axes = np.linalg.eigh(drawn.shapes)
    # The longer axis is that of x; half a turn makes the same ellipse.
    angles = np.unwrap(np.arctan2(axes[:, 1, 1], axes[:, 0, 1]), period=np.pi)
    scales = np.maximum(np.column_stack([sizes[:, ::-1], np.ones(len(sizes))]), _LEAST)
    document.animate(node, "translation", keys.times, keys.poses * [1.0, 1.0, 0.0])
    document.animate(node, "rotation", known, turned(angles))
    document.animate(node, "scale", known, scales)


def _ring(document: Document, outline: Float, opacity: float, material: int) -> dict[str, Any]:
    """A closed outline (c, 2) on the ground, in the estimate's colour."""
    ends = np.roll(outline, -1, axis=0)
    colours = np.tile(look.ESTIMATE_COLOUR, (len(outline), 1))
    opacities = np.full((len(outline), 2), opacity)
    height = look.TRAIL_HEIGHT + 2.0 * _LIFT
    return _lines(document, level_lines(height, outline, ends, colours, opacities, 0.0), material)
