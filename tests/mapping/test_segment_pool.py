import numpy as np
from map_objects import objects_of

from lrf3d.mapping.robust.evidence_grid import EvidenceGrid


def test_segments_that_outgrow_the_grid_of_a_pool_find_their_neighbours():
    # Corners of two walls each, far from one another.
    x, y = (50.0 * axis.ravel() for axis in np.meshgrid(np.arange(30.0), np.arange(30.0)))
    walls = np.vstack([np.stack([x - 4, y, x, y], axis=1), np.stack([x, y, x, y + 4], axis=1)])
    names = objects_of(walls, EvidenceGrid().cells)
    corners = len(x)
    assert np.array_equal(names[:corners], names[corners:])
    assert len(set(names.tolist())) == corners
