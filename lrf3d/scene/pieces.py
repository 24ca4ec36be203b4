"""Faces in pieces: cut small for their light, which is gathered at corners and mixed between."""

import numpy as np

from lrf3d.geometry import Int, Single


def cut_small(quads: Single, step: float, most: int) -> tuple[Single, Int]:
    """Cut quads into pieces no wider and higher than a step [m], for light that changes on them.

    Args:
        quads: (n, 4, k) quads whose values change evenly.
        step: The step [m]; longer where there would be too many pieces.
        most: About how many pieces there may be.

    Returns:
        The pieces (m, 4, k), and which of the quads (m,) each is of.
    """
    place = quads[:, :, :3].astype(np.float64)
    wide, high = (np.linalg.norm(place[:, corner] - place[:, 0], axis=1) for corner in (1, 3))
    while True:
        counts = (np.ceil(side / step - 1e-3) for side in (wide, high))
        across, up = (np.maximum(1, count).astype(int) for count in counts)
        if int((across * up).sum()) <= max(most, len(quads)):
            break
        step *= 1.4
    found, owners = [np.zeros((0, *quads.shape[1:]), np.float32)], [np.zeros(0, np.int64)]
    for columns, rows in np.unique(np.column_stack([across, up]), axis=0).tolist():
        chosen = np.flatnonzero((across == columns) & (up == rows))
        quad = quads[chosen].astype(np.float64)
        s = (np.arange(columns + 1) / columns)[:, None, None]
        bottom = quad[:, None, 0] + s.reshape(1, -1, 1) * (quad[:, None, 1] - quad[:, None, 0])
        top = quad[:, None, 3] + s.reshape(1, -1, 1) * (quad[:, None, 2] - quad[:, None, 3])
        t = (np.arange(rows + 1) / rows).reshape(1, 1, -1, 1)
        grid = bottom[:, :, None] + t * (top - bottom)[:, :, None]
        pieces = np.stack(
            [grid[:, :-1, :-1], grid[:, 1:, :-1], grid[:, 1:, 1:], grid[:, :-1, 1:]], axis=3
        )
        found.append(pieces.reshape(-1, *quads.shape[1:]).astype(np.float32))
        owners.append(np.repeat(chosen, columns * rows))
    return np.concatenate(found), np.concatenate(owners)
