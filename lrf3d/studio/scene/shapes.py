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


# Offset of what nothing hides towards the eye [m]: nearer than all else.
ON_TOP = 1e6

# Distance of a mirror's picture from its wall [m], so that both never share a pixel.
MIRROR_GAP = 0.03

# Height that walls are cut at where they are not [m]: no wall is as high.
UNCUT = 1e4


class Painted(NamedTuple):
    """Walls and roofs with their light. All are quads; a triangle has its last corner twice."""

    # (n, 4, 3) corners, counter-clockwise from outside [m].
    places: Single
    # (n, 4, 3) colours.
    colours: Single
    # (n, 4, 3) the place on the ground whose first-seen time a corner has, x and y [m], and 1; of a
    # roof, which no beam meets, the wall whose colour it takes, and 0.
    before: Single
    # (n, 4, 4) for each corner its place along the wall, the wall's length and height [m], and what
    # the wall shows: a kind of `stage`, plus a fraction that differs between objects.
    skin: Single
    # (n,) the object of each.
    objects: NDArray[np.int64]

    def rows(self) -> Single:
        """Corners (n, 4, 9): place, colour, place before it."""
        return np.concatenate(self[:3], axis=2)


class GroundPicture(NamedTuple):
    """The ground in its light."""

    # (h, w, 3) its picture, whose row 0 is at the smallest y.
    picture: Pixels
    # (2,) its lower left corner [m].
    corner: Float
    # (2,) its width and height [m].
    size: Float
    # (3,) the colour of the land, in which it ends.
    land: Float


class Faces(NamedTuple):
    """Opaque triangles."""

    # (t, 3, 3) corners [m].
    corners: Single
    # (t, 3, 3) colours of the corners.
    colours: Single


class PosedFaces(NamedTuple):
    """A body, the robot or a dynamic obstacle: faces in its own frame, and where that is."""

    faces: Faces
    # (4, 4) the matrix from their frame to the film's.
    pose: Float


class Soft(NamedTuple):
    """Translucent triangles, such as shadows, a goal, the robot as an arrow."""

    # (t, 3, 3) corners [m].
    corners: Single
    # (t, 3, 4) colours and opacities of the corners.
    colours: Single
    # Whether nothing hides them.
    on_top: bool = False


class Lines(NamedTuple):
    """Lines of even width in the picture."""

    # (n, 3) [m].
    starts: Single
    # (n, 3) [m].
    ends: Single
    # (n, 3).
    colours: Single
    # (n, 2) at both ends.
    opacities: Single
    # Width [pixels of 720 lines].
    width: float
    # Least width [m].
    thick: float = 0.0


class Points(NamedTuple):
    """Round points."""

    # (n, 3) [m].
    places: Single
    # (n, 4) colours and opacities.
    colours: Single
    # (n, 2) normals of the walls that they lie on, which hide them from behind, or 0.
    sides: Single
    # Diameter [m].
    size: float
    # The smallest and the largest diameter [pixels of 720 lines].
    pixels: tuple[float, float]
    # Whether light blooms round them.
    glows: bool = True


# What a line of text that names a colour begins with.
NAMED = "━"

# What a line begins with that says what pins point at.
PINNED = "▼"


class Label(NamedTuple):
    """Lines of text under a picture, of which the first is the largest."""

    text: tuple[str, ...]
    # The colour of each line, 0…255.
    colours: tuple[tuple[int, int, int], ...]
    # Height of letters of the first line [pixels of 720 lines].
    size: float


Mark = Lines | Points | Soft


class Lens(NamedTuple):
    """How a picture shows places."""

    # (4, 4) the matrix from places to −1…1 of the picture, whose first row is the upper one.
    matrix: Float
    # (3,) where the eye is [m].
    eye: Float
    # Pixels that a metre takes at a distance of one metre.
    focus: float
    # One over the distance at which half of what is seen is haze [1/m].
    thick: float
    # By how much the depth of marks gains with their distance [m/m].
    slack: float
    # How much nearer to the eye marks are than what they lie on [m].
    nearer: float


class Inset(NamedTuple):
    """A map from straight above."""

    lens: Lens
    marks: tuple[tuple[str, Mark], ...]
    # What time it is, and how fast that passes: see `Exposure.clock`.
    clock: tuple[float, float]


class Tints(NamedTuple):
    """The map of a moment over the cells of an exposure, from which walls take their colours."""

    lens: Lens
    # Its segments; their width is in cells.
    lines: Lines


class Seen(NamedTuple):
    """The content of one picture: bodies and marks by name, in the order of drawing."""

    lens: Lens
    bodies: tuple[tuple[str, PosedFaces], ...]
    marks: tuple[tuple[str, Mark], ...]
    # What time it is, and how fast that passes: see `Exposure.clock`.
    clock: tuple[float, float] = (0.0, 1.0)
    tints: Tints | None = None
    # How far the dark has become dusk, 0…1.
    dusk: float = 0.0
    # Height that walls are cut at [m].
    cut: float = UNCUT
    # Columns that are drawn [pixels]: all of them for 0.
    columns: int = 0


class Reflection(NamedTuple):
    """What is seen in one mirror, through its rectangle.

    The scene is drawn from the mirrored eye before all else; what does not lie past the mirror is
    left out by shaders, and then the rectangle's depth alone closes it.
    """

    # From the mirrored eye.
    lens: Lens
    # The mirror, for shaders: an end and its direction, its length, height and distance [m].
    uniforms: dict[str, tuple[float, ...]]
    # (4, 4) the matrix that mirrors places.
    turn: Float
    # (2, 3, 3) the triangles that close it.
    seal: Single


def reflections(seen: Seen, mirrors: Float) -> Iterator[Reflection]:
    """What is seen in mirrors (m, 5), walls and their heights, that stand in the picture."""
    lens = seen.lens
    for x1, y1, x2, y2, high in mirrors.tolist():
        top = min(high, seen.cut)
        start = np.array([x1, y1])
        along = np.array([x2 - x1, y2 - y1])
        length = float(np.hypot(*along))
        along /= length
        normal = along @ LEFT
        off = float(normal @ (lens.eye[:2] - start))
        foot = start + np.sign(off) * MIRROR_GAP * normal
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
