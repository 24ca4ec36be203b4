import numpy as np

from lrf3d.mapping.robust.evidence_grid import EvidenceGrid
from lrf3d.mapping.robust.joining import join_stretches
from lrf3d.mapping.robust.walls import Rule, Walls

RULE = Rule(0.5, 0.1, 0.04, 1.0)


def stretches_of(*spans):
    """Stretches on the x axis between places, exact to a centimetre."""
    ends = np.array([[a, 0.0, b, 0.0] for a, b in spans])
    spread = 1e4 * (ends[:, 2] - ends[:, 0]) ** 2
    moments = np.zeros((len(ends), 6))
    moments[:, 0], moments[:, 1], moments[:, 3] = 1e4, ends[:, [0, 2]].mean(axis=1), spread / 12.0
    return Walls(ends, moments, np.full(len(ends), 9))


def test_an_update_changes_the_walls_that_it_joins_and_no_others_behind_them():
    # The second and the third stretch are one wall, and so are the fourth and the fifth.
    walls = stretches_of((0, 1), (1.2, 2), (2.2, 3), (9, 10), (10.2, 11))
    joints = np.array([0, 1, 1, 3, 3])
    roots, changed = join_stretches(walls, 1, joints, RULE, EvidenceGrid().cells)
    assert roots.tolist() == [0, 0, 0, 3, 3]
    assert changed.tolist() == [True, True, True, False, False]
    assert walls.ends[0].tolist() == [0, 0, 3, 0]


def test_what_fits_none_of_the_walls_around_leaves_them_as_they_are():
    walls = stretches_of((0, 1), (6, 7), (7.2, 8))
    roots, changed = join_stretches(walls, 1, np.array([0, 1, 1]), RULE, EvidenceGrid().cells)
    assert roots.tolist() == [0, 1, 1] and changed.tolist() == [True, False, False]
