import numpy as np
import pytest

from lrf3d import InputError, LineMap


@pytest.mark.parametrize(
    ("segments", "objects", "message"),
    [
        ([[0, 0, 1]], [0], r"segments \(1, 3\), objects \(1,\)"),
        ([[0, 0, 1, 0]], [0, 1], r"objects \(2,\) and points \(1,\): expected shapes"),
        ([[0, 0, 1, 0], [0, 0, np.inf, 1]], [0, 1], r"segment 1 is \[.*inf.*\], expected finite"),
    ],
)
def test_a_map_that_is_none_is_refused(segments, objects, message):
    with pytest.raises(InputError, match=message):
        LineMap(segments, objects, [9] * len(segments))
