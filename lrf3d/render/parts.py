"""Parts: which objects of a large scene stand in the picture, near ones first.

What is drawn from near to far is painted once: the farther pixels fail their depth test.
"""

import numpy as np
from numpy.typing import NDArray

from lrf3d.geometry import Float, Int, quad_indices
from lrf3d.scene.shapes import Painted


class Parts:
    """The quads of walls and roofs, by their objects."""

    def __init__(self, faces: Painted) -> None:
        owners, self.count = faces.objects, int(faces.objects.max(initial=-1)) + 1
        order = np.argsort(owners, kind="stable")
        self._quads = quad_indices(len(owners)).reshape(-1, 6)[order]
        self._sizes = np.bincount(owners, minlength=self.count)
        self._starts = np.cumsum(self._sizes) - self._sizes
        self._low, self._high = np.full((self.count, 3), np.inf), np.full((self.count, 3), -np.inf)
        np.minimum.at(self._low, owners, faces.places.min(axis=1))
        np.maximum.at(self._high, owners, faces.places.max(axis=1))

    def seen(self, matrix: Float, eye: Float) -> Int:
        """Parts that a picture of a matrix (4, 4) from an eye (3,) may show, near ones first."""
        inside = self._sizes > 0
        for plane in (
            matrix[3], matrix[3] + matrix[0], matrix[3] - matrix[0], matrix[3] + matrix[1],
            matrix[3] - matrix[1],
        ):  # fmt: skip
            # The corner that lies farthest on the inner side of the plane.
            corner = np.where(plane[:3] > 0.0, self._high, self._low)[inside]
            inside[inside] = corner @ plane[:3] + plane[3] > 0.0
        parts = np.flatnonzero(inside)
        gap = np.maximum(self._low[parts, :2] - eye[:2], eye[:2] - self._high[parts, :2])
        gap = np.maximum(gap, 0.0)
        return parts[np.argsort(np.hypot(gap[:, 0], gap[:, 1]), kind="stable")]

    def choose(self, parts: Int) -> NDArray[np.uint32]:
        """Vertices of parts in their order."""
        sizes = self._sizes[parts]
        before = np.cumsum(sizes) - sizes
        chosen = np.repeat(self._starts[parts] - before, sizes) + np.arange(int(sizes.sum()))
        return self._quads[chosen].ravel()
