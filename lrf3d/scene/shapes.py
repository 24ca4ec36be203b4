"""What pictures are made of: faces, lines, points, translucent faces and labels, as plain arrays.

A scene at a moment is a value of these (:class:`Seen`). OpenGL and the plain renderer draw it, glTF
writes it, and the browser's page is sent it: each kind of geometry is drawn once in each, and a new
mark in a scene needs no new code there. An array that is the same object as before has not changed.
All places are in the film's frame [m], all colours are red, green, blue in 0…1.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lrf3d.geometry import Float, Single

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
    """The ground in its light."""

    picture: Pixels
    """(h, w, 3) its picture, which ends in the colour of the land; row 0 at the smallest y."""
    corner: Float
    """(2,) its lower left corner."""
    size: Float
    """(2,) its width and height [m]."""
    land: Float
    """(3,) colour of the land around it, in its light."""


class Faces(NamedTuple):
    """Opaque triangles."""

    corners: Single
    """(t, 3, 3) corners."""
    colours: Single
    """(t, 3, 3) colours."""


class Body(NamedTuple):
    """Faces at a place of their own: the robot, a dynamic obstacle."""

    faces: Faces
    pose: Float
    """(4, 4) the matrix from the body's frame to the film's."""


class Soft(NamedTuple):
    """Translucent triangles: shadows on the ground, a goal, the robot as an arrow."""

    corners: Single
    """(t, 3, 3) corners."""
    colours: Single
    """(t, 3, 4) colours and opacities."""
    on_top: bool = False
    """Whether nothing hides them."""


class Lines(NamedTuple):
    """Lines of even width in the picture."""

    starts: Single
    """(n, 3) first ends."""
    ends: Single
    """(n, 3) second ends."""
    colours: Single
    """(n, 3) colours."""
    opacities: Single
    """(n, 2) opacities at both ends."""
    width: float
    """Width [pixels of 720 lines]."""
    thick: float = 0.0
    """Least width [m]."""


class Points(NamedTuple):
    """Round points."""

    places: Single
    """(n, 3) places."""
    colours: Single
    """(n, 4) colours and opacities."""
    sides: Single
    """(n, 2) where the wall looks that each lies on: from behind it is not seen; 0 for none."""
    size: float
    """Diameter [m]."""
    pixels: tuple[float, float]
    """The smallest and the largest diameter [pixels of 720 lines]."""
    glows: bool = True
    """Whether light blooms round them."""


class Label(NamedTuple):
    """Lines of text in the lower left corner, of which the first is the largest."""

    text: tuple[str, ...]
    """Its lines."""
    colours: tuple[tuple[int, int, int], ...]
    """The colour of each, 0…255."""
    size: float
    """Height of letters [pixels of 720 lines]."""


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
    """A map in a corner of the picture, seen from straight above."""

    box: tuple[int, int, int, int]
    """Left, top, width and height [pixels]."""
    lens: Lens
    marks: tuple[tuple[str, Mark], ...]


class Tints(NamedTuple):
    """The map of a moment as a picture over the cells of an exposure: walls take its colours."""

    lens: Lens
    lines: Lines
    """Its segments, whose width is in cells."""


class Seen(NamedTuple):
    """All that is to be seen in one picture."""

    lens: Lens
    bodies: tuple[tuple[str, Body], ...]
    """Opaque bodies by name."""
    marks: tuple[tuple[str, Mark], ...]
    """Marks by name, in the order in which they are drawn."""
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
    return Lines(
        single(np.hstack([starts, level])),
        single(np.hstack([ends, level])),
        single(colours),
        single(opacities),
        width,
    )
