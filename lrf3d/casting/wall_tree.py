"""WallTree: walls in a tree of boxes, so that a scan visits only what its beams can meet.

Boxes are split where the surface-area heuristic finds it cheapest (in the plane: half the
perimeter of a box is in proportion to the beams that meet it). Unlike the cells of a grid, boxes
take worlds of any density and scale, and a wall lies in one leaf however long it is.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lrf3d.casting.kernels.tree import SMALL, build


class WallTree(NamedTuple):
    """Boxes over walls, as arrays that compiled code takes.

    Attributes:
        boxes: (m, 4) smallest x, y and largest x, y [m] of each node; node 0 is the root.
        links: (m, 2) for a leaf the row of its first wall and how many it holds; for a node
            above others the first of its children, which lie side by side, and minus how many.
        walls: (n, 4) ends of the walls [m] in the order of the leaves.
        rows: (n,) which wall of the world each of them is.
    """

    boxes: NDArray[np.float64]
    links: NDArray[np.int32]
    walls: NDArray[np.float64]
    rows: NDArray[np.int32]

    @property
    def nbytes(self) -> int:
        """Memory of the tree [bytes], walls included."""
        return sum(array.nbytes for array in self)


def build_tree(segments: NDArray[np.float64], index: NDArray[np.int32] | None = None) -> WallTree:
    """Build the tree over segments (n, 4); index names them where they are a part of a world."""
    segments = np.ascontiguousarray(segments, dtype=np.float64)
    count = len(segments)
    order = np.arange(count, dtype=np.int32)
    capacity = 1 if count <= SMALL else 2 * count
    boxes = np.empty((capacity, 4))
    links = np.zeros((capacity, 2), dtype=np.int32)
    used = build(segments, order, boxes, links)
    names = order if index is None else index[order]
    return WallTree(boxes[:used].copy(), links[:used].copy(), segments[order], names)
