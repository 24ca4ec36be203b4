"""The map as it is drawn: lines, and slim bands on the mapped walls, which at the end stand up."""

from dataclasses import dataclass

import numpy as np
import trimesh

from lrf3d.geometry import Float, lengths
from lrf3d.run import Run
from lrf3d.scene.look import object_tints
from lrf3d.scene.shapes import Faces, Lines, level_lines, single
from lrf3d.scene.structures import Structures

BAND = (0.62, 0.74)
"""Heights between which the map is a band along the walls, above the beams [m]."""

_WIDTH, _WIDEST = 0.07, 3.0
"""Width of a band [m], which stands out of its line to both sides, so that no wall hides it; bands
that are far away are drawn higher, and at most this number of times as thick."""

_LOWEST, STANDING = 0.02, 2.5
"""Height above the ground that bands keep, and that of a mapped wall which stands up where the
world has none [m]."""

_BOX = trimesh.creation.box()
_SEEN = _BOX.face_normals[:, 2] > -0.5
_PLACES, _NORMALS = _BOX.triangles[_SEEN].reshape(-1, 3), _BOX.face_normals[_SEEN].repeat(3, axis=0)
"""Corners (3 t, 3) of the triangles of a unit box round the origin, without its bottom, and
their normals."""


@dataclass(frozen=True, eq=False, slots=True)
class DrawnMap:
    """A map as it is drawn, each object in its colour."""

    segments: Float
    """(m, 4) its segments in the film's frame [m]."""
    colours: Float
    """(m, 3) red, green, blue in 0…1."""
    tops: Float
    """(m,) heights of the walls that they lie on [m]; infinite where there is none."""

    @classmethod
    def from_snapshot(cls, run: Run, number: int, structures: Structures) -> "DrawnMap":
        """Take a map snapshot of a run; −1 is the empty map before the first."""
        if number < 0:
            return cls(np.zeros((0, 4)), np.zeros((0, 3)), np.zeros(0))
        # The numbers of objects last while a map grows.
        colours = object_tints(run.lasting_objects[number])
        segments = run.maps[number].segments - np.tile(structures.origin, 2)
        return cls(segments, colours, structures.tops(segments))

    def lines(self, height: float, width: float, opacity: float = 1.0) -> Lines:
        """Its segments as lines at a height [m], of a width [pixels] and an opacity."""
        opacities = np.full((len(self.segments), 2), opacity)
        starts, ends = np.hsplit(self.segments, 2)
        return level_lines(height, starts, ends, self.colours, opacities, width)

    def bands(self, eye: Float, *, least: float, raised: float = 0.0) -> Faces:
        """Bands on the walls, for an eye (3,); raised by a share 0…1 they stand up to their tops.

        They are at least so high [m] for each metre that they are away from the eye.
        """
        half = 0.5 * (BAND[1] - BAND[0])
        middle = np.minimum(self.tops, BAND[1]) - half
        start, end = np.hsplit(self.segments, 2)
        away = np.linalg.norm(np.column_stack([0.5 * (start + end), middle]) - eye, axis=1)
        size = np.maximum(1.0, least * away / half)
        low = np.maximum(middle - half * size, _LOWEST)
        high = np.minimum(middle + half * size, self.tops)
        standing = np.where(np.isfinite(self.tops), self.tops, STANDING)
        low, high = low + raised * (_LOWEST - low), high + raised * (standing - high)
        thick = _WIDTH * np.minimum(size, _WIDEST) * (1.0 + raised)
        # Each band is the unit box in a frame of its own: along, across and up.
        frames = np.zeros((len(size), 3, 3))
        frames[:, 0, :2] = along = end - start
        side = thick / np.maximum(lengths(self.segments), 1e-9)
        frames[:, 1, :2] = side[:, None] * np.column_stack([-along[:, 1], along[:, 0]])
        frames[:, 2, 2] = high - low
        middles = np.column_stack([0.5 * (start + end), 0.5 * (low + high)])
        corners = single(middles[:, None] + _PLACES @ frames)
        normals = np.zeros_like(corners)
        if raised > 0.0:
            # Standing walls are lit, so that their sides differ; bands shine by themselves.
            sizes = np.linalg.norm(frames, axis=2, keepdims=True)
            normals[:] = _NORMALS @ (frames / np.maximum(sizes, 1e-9))
        colours = np.broadcast_to(self.colours[:, None], corners.shape)
        return Faces(*(single(each).reshape(-1, 3, 3) for each in (corners, normals, colours)))
