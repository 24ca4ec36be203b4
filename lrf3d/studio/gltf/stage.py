"""What stands in a scene, as glTF: ground, walls and roofs, dark and as the laser has lit them.

No viewer of glTF knows the film's shaders. So what was seen is written twice, in the dark and in
the light and the map's colours of the end, and in some steps one takes the other's place. What
plays no animation shows the end. All stands in a local frame, whose origin the root node keeps as
``origin``: glTF counts in float32, which knows no centimetres far away.
"""

from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np
from PIL import Image

from lrf3d.geometry.lines import Bool, Float, Single, quad_indices
from lrf3d.studio.gltf.document import Document
from lrf3d.studio.render.glsl import exposed, mesh
from lrf3d.studio.scene import look
from lrf3d.studio.scene.marks import DrawnMap
from lrf3d.studio.scene.stage.stage import Stage

# Number of steps in which a run's world is lit.
_STEPS = 12

# Side of the squares in which the ground is lit [cells].
_COARSE = 6

# Least surety with which something was seen that is lit.
_LEAST_SURE = 0.05

# Side of the pieces in which the walls of a town are lit [m].
_STEP = 3.2

# Side of the pieces in which the walls of rooms are lit [m].
_STEP_INDOOR = 0.8

# Largest number of pieces, which are larger where there would be more.
_MOST_PIECES = 60_000

# Margin of the ground around its picture, as a multiple of the picture's longer side.
_MARGIN = 0.25


def add_stage(document: Document, stage: Stage, drawn: DrawnMap) -> None:
    """Add ground, walls and roofs, and the map's colours on them."""
    _add_ground(document, stage)
    rows = cut_small(stage.faces.rows(), _STEP_INDOOR if stage.structures.indoor else _STEP)
    rows = rows[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3, 9)
    rows = rows[(rows[:, 1, :3] != rows[:, 2, :3]).any(axis=1)]
    if len(rows):
        _add_walls(document, rows, stage, drawn)


def _steps(seen: Float, sure: Float) -> Iterator[tuple[int, Bool]]:
    """The steps in which places (n,) are lit that were first seen then, and how surely.

    Each comes with those places; first, as −1, those that never are.
    """
    step = np.ceil(np.clip(seen, 0.0, 1.0) * (_STEPS - 1)).astype(int)
    step[sure <= _LEAST_SURE] = -1
    for number in np.unique(step).tolist():
        yield number, step == number


def _add_ground(document: Document, stage: Stage) -> None:
    ground = stage.ground
    exposure = stage.exposure
    setting = stage.structures.setting
    x, y = (
        low + (np.arange(count) + 0.5) / count * size
        for low, count, size in zip(
            ground.corner, ground.picture.shape[1::-1], ground.size, strict=True
        )
    )
    dark, seen = np.empty((2, *ground.picture.shape), np.uint8)
    # A row at a time, as numbers of the whole picture would take half a gigabyte.
    for row, height in enumerate(y):
        on = exposure.sampled(np.column_stack([x, np.full_like(x, height)]))["sure"]
        for painted, share in ((dark, np.zeros_like(on)), (seen, on)):
            colours = exposed(ground.picture[row] / look.WHITE, share, 0.0, setting)
            painted[row] = np.round(look.WHITE * np.clip(colours, 0.0, 1.0))
    rows, columns = (np.arange(0, side, _COARSE) for side in exposure.times.shape)
    low = np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2)
    squares = low[:, None] + _COARSE * np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    squares = exposure.corner + exposure.cell * squares
    first, covered = (
        along.reduceat(along.reduceat(exposure.times[name], rows, 0), columns, 1).ravel()
        for along, name in ((np.minimum, "seen"), (np.maximum, "sure"))
    )
    unlit, lit = (
        document.material(name, texture=document.texture(name, Image.fromarray(each), "JPEG"))
        for name, each in (("ground", dark), ("lit ground", seen))
    )
    # Eight more rectangles around the squares are a margin. None overlap, since viewers
    # cannot decide from far away which is nearer.
    low, high = squares[[0, -1], [0, 2]]
    margin = _MARGIN * float(np.max(high - low))
    nine = mesh(*np.array([low - margin, low, high, high + margin]).T).reshape(9, 6, 2)
    around = np.delete(nine[:, [0, 1, 2, 5]], 4, axis=0)
    group = document.node("lit ground", document.root)

    def part(material: int, quads: Float) -> dict[str, Any]:
        # The first row of a picture lies at v = 0, here at the smallest y.
        level = quads.reshape(-1, 2)[quad_indices(len(quads))]
        uv = (level - ground.corner) / ground.size
        return document.part(material, np.insert(level, 2, 0.0, axis=1), texture=uv)

    document.node(
        "ground",
        document.root,
        part(unlit, np.concatenate([around, squares[covered <= _LEAST_SURE]])),
    )
    for number, those in _steps(first, covered):
        if number >= 0:
            both = (partial(part, each, squares[those]) for each in (unlit, lit))
            _show(document, group, exposure.length * number / (_STEPS - 1), *both)


def _show(document: Document, group: int, begin: float, unlit: Any, lit: Any) -> None:
    """Show one part until a time [s], and another from then on; both are functions."""
    if begin > 0.0:
        document.show(
            document.node(f"dark until {begin:.1f} s", group, unlit()), 0.0, begin, rests=False
        )
    document.show(document.node(f"lit from {begin:.1f} s", group, lit()), begin, rests=True)


def _add_walls(document: Document, rows: Single, stage: Stage, drawn: DrawnMap) -> None:
    exposure = stage.exposure
    setting = stage.structures.setting
    # Of each corner: place and height, colour, the place before it, and whether this is a wall.
    places, height, day, before, wall = np.split(rows.astype(float), [2, 3, 6, 8], axis=2)
    height = height[..., 0]
    wall = wall[..., 0]
    when = exposure.sampled(before.reshape(-1, 2)).reshape(wall.shape)
    on = wall * when["sure"]
    dark, shown = (exposed(day, share, height, setting) for share in (np.zeros_like(on), on))
    middles = np.where(wall[..., None] > 0.5, places, before).mean(axis=1)
    tints, found = drawn.tints(middles, exposure.tolerance)
    share = np.where(wall > 0.5, np.minimum(2.0 * when["sure"], 1.0), setting.top)
    share *= look.MAP_SHARE * found[:, None]
    low, more = look.MAP_LIGHT
    shown += share[..., None] * (
        tints[:, None] * (low + more * (day @ look.GREY))[..., None] - shown
    )
    material = document.material("walls")
    group = document.node("lit walls", document.root)
    for number, chosen in _steps(when["seen"].min(axis=1), np.maximum(on, share).max(axis=1)):
        unlit, lit = (
            partial(document.part, material, rows[chosen][..., :3], each[chosen], kind=np.uint16)
            for each in (dark, shown)
        )
        if number < 0:
            document.node("walls", document.root, unlit())
        else:
            _show(document, group, exposure.length * number / (_STEPS - 1), unlit, lit)


def cut_small(quads: Single, step: float) -> Single:
    """Halve quads (n, 4, k) of walls until no side is longer than a step [m], or they are many."""
    walls = quads[quads[:, 0, 8] > 0.5]
    sides = np.linalg.norm(walls[:, [1, 3], :3] - walls[:, :1, :3], axis=2)
    step = max(step, float(np.sqrt(sides.prod(axis=1).sum() / _MOST_PIECES)))
    while (long := np.linalg.norm(walls[:, 1, :3] - walls[:, 0, :3], axis=1) > step).any() or (
        np.linalg.norm(walls[:, 3, :3] - walls[:, 0, :3], axis=1) > step
    ).any():
        one = walls[long].copy()
        other = walls[long].copy()
        middles = 0.5 * (one + one[:, [1, 0, 3, 2]])
        one[:, 1:3] = middles[:, 1:3]
        other[:, [0, 3]] = middles[:, [0, 3]]
        # In turns along the walls and up.
        walls = np.roll(np.concatenate([walls[~long], one, other]), 1, axis=1)
    return np.concatenate([walls, quads[quads[:, 0, 8] <= 0.5]])
