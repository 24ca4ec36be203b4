"""What pictures are made of: faces, lines, points, translucent faces and labels, as plain arrays.

A scene at a moment is a value of these (:class:`Seen`). OpenGL and the plain renderer draw it, glTF
writes it, and the browser's page is sent it: each kind of geometry is drawn once in each, and a new
mark in a scene needs no new code there. An array that is the same object as before has not changed.
All places are in the film's frame [m], all colours are red, green, blue in 0…1.
"""

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lrf3d.geometry.lines import LEFT, Float, Single

Pixels = NDArray[np.uint8]


class Painted(NamedTuple):
    """Walls and roofs with their light. All are quads; a triangle has its last corner twice."""

    places: Single
    """(n, 4, 3) corners, counter-clockwise from outside."""
    colours: Single
    """(n, 4, 3) colours."""
    before: Single
    """(n, 4, 3) the place on the ground whose first-seen time a corner has, x and y [m], and 1; of
    a roof, which no beam meets, the wall whose colour it takes, and 0."""
    objects: NDArray[np.int64]
    """(n,) the object of each."""

    def rows(self) -> Single:
        """Corners (n, 4, 9): place, colour, place before it."""
        return np.concatenate(self[:3], axis=2)


class GroundPicture(NamedTuple):
    """The ground in its light: a picture (h, w, 3), whose row 0 is at the smallest y.

    Its lower left corner (2,), its width and height (2,) [m]; and the colour (3,) of the land,
    in which it ends.
    """

    picture: Pixels
    corner: Float
    size: Float
    land: Float


class Faces(NamedTuple):
    """Opaque triangles: corners (t, 3, 3) and their colours (t, 3, 3)."""

    corners: Single
    colours: Single


class Body(NamedTuple):
    """Faces at a pose (4, 4) from their own frame to the film's: the robot, a dynamic obstacle."""

    faces: Faces
    pose: Float


class Soft(NamedTuple):
    """Translucent triangles, such as shadows, a goal, the robot as an arrow.

    Corners (t, 3, 3), their colours and opacities (t, 3, 4), and whether nothing hides them.
    """

    corners: Single
    colours: Single
    on_top: bool = False


class Lines(NamedTuple):
    """Lines of even width in the picture: ends (n, 3), colours (n, 3), opacities (n, 2) at both."""

    starts: Single
    ends: Single
    colours: Single
    opacities: Single
    width: float
    """Width [pixels of 720 lines]."""
    thick: float = 0.0
    """Least width [m]."""


class Points(NamedTuple):
    """Round points: places (n, 3), colours and opacities (n, 4).

    The sides (n, 2) are normals of the walls that they lie on, which hide them from behind, or 0.
    """

    places: Single
    colours: Single
    sides: Single
    size: float
    """Diameter [m]."""
    pixels: tuple[float, float]
    """The smallest and the largest diameter [pixels of 720 lines]."""
    glows: bool = True
    """Whether light blooms round them."""


class Label(NamedTuple):
    """Lines of text in the lower left corner, of which the first is the largest.

    The colour of each, 0…255, and the height of letters [pixels of 720 lines].
    """

    text: tuple[str, ...]
    colours: tuple[tuple[int, int, int], ...]
    size: float


Mark = Soft | Lines | Points


class Lens(NamedTuple):
    """How places become pixels."""

    matrix: Float
    """(4, 4) from the film's frame to −1…1 of the picture, whose first row is the upper one."""
    eye: Float
    """(3,) where the eye is."""
    focus: float
    """Pixels that a metre takes at a distance of one metre."""
    thick: float
    """One over the distance at which half of what is seen is haze [1/m]."""
    slack: float
    """By how much the depth of marks gains with their distance [m/m]."""
    nearer: float
    """How much nearer to the eye marks are than what they lie on [m]."""


class Plan(NamedTuple):
    """A map from straight above in a box of the picture: left, top, width and height [pixels]."""

    box: tuple[int, int, int, int]
    lens: Lens
    marks: tuple[tuple[str, Mark], ...]


class Tints(NamedTuple):
    """The map of a moment over the cells of an exposure, from which walls take their colours.

    Its segments are lines whose width is in cells.
    """

    lens: Lens
    lines: Lines


class Seen(NamedTuple):
    """The content of one picture: bodies and marks by name, in the order of drawing."""

    lens: Lens
    bodies: tuple[tuple[str, Body], ...]
    marks: tuple[tuple[str, Mark], ...]
    clock: tuple[float, float] = (0.0, 1.0)
    """What time it is, and how fast that passes: see :meth:`Exposure.clock`."""
    tints: Tints | None = None
    glass: float = 0.0
    """How far what was never seen has become glass, 0…1."""
    robot: tuple[float, float, float] | None = None
    """The robot, where what hides it is opened."""
    cut: float = 1e4
    """Height that walls are cut at [m]; no wall is as high as the default."""
    plan: Plan | None = None


class Reflection(NamedTuple):
    """What is seen in one mirror, through its rectangle.

    The scene is drawn from the mirrored eye before all else; what does not lie past the mirror is
    left out by shaders, and then the rectangle's depth alone closes it.
    """

    lens: Lens
    """From the mirrored eye."""
    uniforms: dict[str, tuple[float, ...]]
    """The mirror, for shaders: an end and its direction, its length, height and distance [m]."""
    turn: Float
    """(4, 4) the matrix that mirrors places."""
    seal: Single
    """(2, 3, 3) the triangles that close it."""


def reflections(seen: Seen, mirrors: Float) -> Iterator[Reflection]:
    """What is seen in mirrors (m, 5), walls and their heights, that stand in the picture."""
    lens = seen.lens
    nearer = 0.03  # How far before its wall a mirror stands [m].
    for x1, y1, x2, y2, high in mirrors.tolist():
        top = min(high, seen.cut)
        start = np.array([x1, y1])
        along = np.array([x2 - x1, y2 - y1])
        length = float(np.hypot(*along))
        along /= length
        normal = along @ LEFT
        off = float(normal @ (lens.eye[:2] - start))
        foot = start + np.sign(off) * nearer * normal
        ends = np.array([foot, foot + length * along])[[0, 1, 1, 0, 1, 0]]
        corners = np.column_stack([ends, [0.0, 0.0, top, 0.0, top, top]])
        clip = corners @ lens.matrix[:, :3].T + lens.matrix[:, 3]
        sides = clip[:, 3:] + np.hstack([clip[:, :2], -clip[:, :2]])
        if off == 0.0 or (sides < 0.0).all(axis=0).any() or (clip[:, 3] < 0.0).all():
            continue
        turn = np.eye(4)
        turn[:2, :2] -= 2.0 * np.outer(normal, normal)
        turn[:2, 3] = 2.0 * normal * (normal @ start)
        lens_behind = lens._replace(
            matrix=lens.matrix @ turn, eye=lens.eye - 2.0 * off * np.array([*normal, 0.0])
        )
        uniforms = {"mirror": (x1, y1, *along.tolist()), "mirror_size": (length, top, off)}
        yield Reflection(lens_behind, uniforms, turn, single(corners.reshape(2, 3, 3)))


def together(marks: Sequence[Any]) -> Any:
    """Marks of one kind and look as one."""
    first, *others = marks
    joined = {
        name: np.concatenate([value, *(getattr(other, name) for other in others)])
        for name, value in first._asdict().items()
        if others and isinstance(value, np.ndarray)
    }
    return first._replace(**joined)


def single(values: Any) -> Single:
    """Values as a contiguous array of float32."""
    return np.ascontiguousarray(values, np.float32)


def level_lines(
    height: float, starts: Float, ends: Float, colours: Float, opacities: Float, width: float
) -> Lines:
    """Lines from (n, 2) to (n, 2) at a height [m]."""
    level = np.full((len(starts), 1), height)
    begin, end = (single(np.hstack([places, level])) for places in (starts, ends))
    return Lines(begin, end, single(colours), single(opacities), width)
