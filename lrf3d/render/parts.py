"""Parts: which pieces of a large scene stand in the picture, near ones first.

What is drawn from near to far is painted once: the farther pixels fail their depth test.
"""

import numpy as np
from numpy.typing import NDArray

from lrf3d.geometry import Float, Int, quad_indices
from lrf3d.scene.facades import BLANK
from lrf3d.scene.shapes import Painted

_LONGEST = 60.0
"""Side of a square [m] that a part is cut to: a block of a mile is not drawn for its corner."""


class Parts:
    """The quads of walls and roofs by parts, one for each object or piece of it."""

    def __init__(self, faces: Painted) -> None:
        owners, count = _owners(faces)
        # Of each part there are two runs of quads, first of all with a texture, then of bare:
        # those without one have a program of their own, which takes half the time.
        runs = owners + count * (faces.texture[:, 0, 2] == BLANK)
        order = np.argsort(runs, kind="stable")
        self.quads = quad_indices(len(owners)).reshape(-1, 6)[order]
        self._sizes = np.bincount(runs, minlength=2 * count)
        self._starts = np.cumsum(self._sizes) - self._sizes
        self.count = count
        self._low, self._high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
        np.minimum.at(self._low, owners, faces.places.min(axis=1))
        np.maximum.at(self._high, owners, faces.places.max(axis=1))

    def seen(self, matrix: Float, eye: Float) -> Int:
        """Parts that a picture of a matrix (4, 4) from an eye (3,) may show, near ones first."""
        inside = np.ones(self.count, dtype=bool)
        for plane in (
            matrix[3], matrix[3] + matrix[0], matrix[3] - matrix[0], matrix[3] + matrix[1],
            matrix[3] - matrix[1],
        ):  # fmt: skip
            # The corner that lies farthest on the inner side of the plane.
            corner = np.where(plane[:3] > 0.0, self._high, self._low)
            inside &= corner @ plane[:3] + plane[3] > 0.0
        parts = np.flatnonzero(inside)
        gap = np.maximum(self._low[parts, :2] - eye[:2], eye[:2] - self._high[parts, :2])
        gap = np.maximum(gap, 0.0)
        return parts[np.argsort(np.hypot(gap[:, 0], gap[:, 1]), kind="stable")]

    def choose(self, parts: Int) -> tuple[NDArray[np.uint32], int]:
        """Vertices of parts in their order, and how many of the first ones have a texture."""
        runs = np.concatenate([parts, parts + self.count])
        sizes = self._sizes[runs]
        before = np.cumsum(sizes) - sizes
        chosen = np.repeat(self._starts[runs] - before, sizes) + np.arange(int(sizes.sum()))
        return self.quads[chosen].ravel(), 6 * int(self._sizes[parts].sum())


def _owners(faces: Painted) -> tuple[Int, int]:
    """The part (n,) of each quad, and the number of parts."""
    middles, objects = faces.places[..., :2].mean(axis=1), faces.objects
    count = int(objects.max(initial=-1)) + 1
    low, high = np.full((count, 2), np.inf), np.full((count, 2), -np.inf)
    np.minimum.at(low, objects, middles)
    np.maximum.at(high, objects, middles)
    cells = np.floor(middles / _LONGEST).astype(np.int64)
    # Small objects are one part wherever they stand.
    cells[((high - low).max(axis=1) <= _LONGEST)[objects]] = 0
    _, owners = np.unique(np.column_stack([objects, cells]), axis=0, return_inverse=True)
    owners = owners.reshape(-1)
    return owners, int(owners.max(initial=-1)) + 1
