"""The estimate of a run as glTF: its trail, its ellipses, and the current one, which moves."""

import numpy as np

from lrf3d.geometry import Float, quad_indices
from lrf3d.gltf.document import INDICES, KEYS, VERTICES, Document, linear
from lrf3d.gltf.showing import Showing
from lrf3d.gltf.trail import add_trail
from lrf3d.scene import look
from lrf3d.scene.estimate import CORNERS, DrawnEstimate, ring_quads
from lrf3d.scene.timeline import DriveKeys, Timeline

_RIM = 0.08
"""Width of the rim of the ellipse of now, as a share of its half axes."""

_LEAST = 1e-3
"""Half axis [m] that it has at the least: a node without a size has no axes."""


def add_estimate(document: Document, timeline: Timeline) -> None:
    """Add the estimate of a run; nothing if the poses were given to the robot."""
    estimate = DrawnEstimate.from_timeline(timeline)
    if estimate is None:
        return
    _add_estimated_trail(document, estimate)
    if len(estimate.ellipse_times):
        _add_kept(document, estimate, Showing(document, timeline.start, timeline.end), timeline)
        _add_current(document, estimate)


def _add_estimated_trail(document: Document, estimate: DrawnEstimate) -> None:
    poses = np.column_stack([estimate.places, np.zeros(len(estimate.places))])
    keys = DriveKeys(estimate.times, poses, np.zeros(max(len(poses) - 1, 0), np.bool_))
    height = look.TRAIL_HEIGHT + look.ESTIMATE_LIFT
    add_trail(document, keys, "estimate", look.ESTIMATE_COLOUR, look.ESTIMATE_WIDTH, height)


def _add_kept(
    document: Document, estimate: DrawnEstimate, showing: Showing, timeline: Timeline
) -> None:
    """The ellipses that stay, from when the robot was there."""
    material = document.glowing("ellipses", translucent=True)
    group = document.node("ellipses", document.root)
    times = (estimate.ellipse_times[estimate.kept] + timeline.start).tolist()
    for outline, begin in zip(estimate.outlines(), times, strict=True):
        corners = ring_quads(outline[None], look.ESTIMATE_WIDTH)
        mesh = _ring(document, "ellipse", corners, look.ESTIMATE_FADED, material)
        node = document.node(f"ellipse from {begin:.1f} s", group, mesh=mesh)
        showing.between(node, begin, timeline.end)


def _add_current(document: Document, estimate: DrawnEstimate) -> None:
    """The ellipse of now: a circle that is moved, turned and stretched."""
    angle = 2.0 * np.pi * np.arange(CORNERS) / CORNERS
    circle = np.column_stack([np.cos(angle), np.sin(angle)])[None]
    material = document.glowing("ellipse of now", translucent=True)
    mesh = _ring(document, "ellipse of now", ring_quads(circle, _RIM), 1.0, material)
    sizes, axes = np.linalg.eigh(estimate.shapes)
    # The longer axis is that of x; half a turn makes the same ellipse.
    turn = 0.5 * np.unwrap(np.arctan2(axes[:, 1, 1], axes[:, 0, 1]), period=np.pi)
    turns = np.zeros((len(turn), 4), np.float32)
    turns[:, 2], turns[:, 3] = np.sin(turn), np.cos(turn)
    scales = np.maximum(np.column_stack([sizes[:, ::-1], np.ones(len(sizes))]), _LEAST)
    places = np.zeros((len(estimate.places), 3), np.float32)
    places[:, :2] = estimate.places
    node = document.node(
        "ellipse of now",
        document.root,
        mesh=mesh,
        translation=places[0].tolist(),
        rotation=turns[0].tolist(),
        scale=scales[0].tolist(),
    )
    for path, times, values in (
        ("translation", estimate.times, places),
        ("rotation", estimate.ellipse_times, turns),
        ("scale", estimate.ellipse_times, scales.astype(np.float32)),
    ):
        if len(times) > 1:
            keys = document.array(times.astype(np.float32), KEYS, bounded=True)
            document.animate(node, path, keys, document.array(values, KEYS))


def _ring(document: Document, name: str, corners: Float, opacity: float, material: int) -> int:
    """The mesh of quads (q, 4, 2) on the ground, in the estimate's colour."""
    flat = corners.reshape(-1, 2)
    height = look.TRAIL_HEIGHT + 2.0 * look.ESTIMATE_LIFT
    positions = np.column_stack([flat, np.full(len(flat), height)]).astype(np.float32)
    colour = np.append(linear(np.array(look.ESTIMATE_COLOUR)), opacity)
    colours = np.tile(np.round(255.0 * colour).astype(np.uint8), (len(flat), 1))
    attributes = {
        "POSITION": document.array(positions, VERTICES, bounded=True),
        "COLOR_0": document.array(colours, VERTICES, normalised=True),
    }
    indices = document.array(quad_indices(len(corners)), INDICES)
    return document.mesh(name, [document.part(material, attributes, indices)])
