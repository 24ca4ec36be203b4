"""Arrays that meshes are made of; whoever only reckons with them needs no OpenGL."""

import numpy as np
from numpy.typing import NDArray

Single = NDArray[np.float32]


def quad_indices(quads: int) -> NDArray[np.uint32]:
    """Indices (6 · quads,) of two triangles for each four vertices that run round a quad."""
    first = np.arange(quads, dtype=np.uint32)[:, None] * 4
    corners = np.array([[0, 1, 2, 0, 2, 3]], dtype=np.uint32)
    return (first + corners).ravel()
