"""What moves, or stood for a while, leaves the map and the cells; what stays is in both."""

import numpy as np
import pytest

from lrf3d import (
    DynamicObstacle,
    LaserRangeFinder,
    LineMapper,
    PlanarCaster,
    ProportionalNoise,
    Trajectory,
    World,
    simulate,
)
from lrf3d.casting.dynamic_obstacle import round_outline
from lrf3d.laser import RangeNoise
from lrf3d.mapping.robust.beams import Beams
from lrf3d.mapping.robust.constants import LEAST_HITS
from lrf3d.mapping.robust.evidence_grid import EvidenceGrid
from lrf3d.mapping.robust.refitting import violation_weight

LRF = LaserRangeFinder(range_max=30.0)
CORRIDOR = World(np.array([[-2, -1.5, 20, -1.5], [20, -1.5, 20, 1.5], [20, 1.5, -2, 1.5]]))


def walked_by(speed, start):
    """The map of a drive along the corridor in which a person walks along beside the robot."""
    times = 0.25 * np.arange(60)
    drive = Trajectory(times, np.column_stack([0.7 * times, np.zeros(60), np.zeros(60)]))
    end = start + speed * times[-1]
    path = Trajectory([0.0, times[-1]], [(start, 0.8, 0.0), (end, 0.8, 0.0)])
    person = DynamicObstacle(round_outline(0.25), path)
    run = simulate(
        CORRIDOR, drive, LRF, noise=ProportionalNoise(0.02), mapper=LineMapper(), rng=0,
        obstacles=[person],
    )  # fmt: skip
    return run.map.segments


@pytest.mark.parametrize(
    ("speed", "start", "most"), [(-1.0, 14.0, 0), (0.4, 2.0, 1), (-0.3, 9.0, 1)]
)
def test_who_walks_through_a_corridor_leaves_hardly_a_wall(speed, start, most):
    segments = walked_by(speed, start)
    inside = (np.abs(segments[:, [1, 3]]) < 1.3).all(axis=1) & (segments[:, [0, 2]] < 19.5).any(1)
    # Who is slow is seen longest where the robot passes by, and never again.
    assert len(segments) - inside.sum() == 3 and inside.sum() <= most


def test_beams_through_what_one_scan_hit_weigh_more_than_through_what_many_did():
    def weight(hits, violations, scans, between):
        return violation_weight.py_func(np.array([hits, violations, 0.0, scans, between]))

    assert weight(20, 40, 2, 0) > weight(20, 40, 20, 0) > weight(20, 40, 20, 20)
    # What came between hits is little beside all that came before and after.
    assert weight(20, 400, 2, 2) == weight(20, 400, 2, 0) > weight(20, 4, 2, 2)


def test_what_all_beams_go_through_leaves_the_cells():
    grid, noise = EvidenceGrid(), RangeNoise(0.01, 0.0)
    box = World(np.array([[5, -1, 5, 1.0]]))
    for world, times in ((box, 3), (World(np.array([[9, -4, 9, 4.0]])), 90)):
        scan = PlanarCaster(world).cast(LRF, (0, 0, 0))
        for _ in range(times):
            grid.add(Beams.of(scan, 0.0, noise), (0.03, 0.04))
    cells = grid.cells
    used = cells.moments[: cells.used[0]]
    left = used[used[:, 0] > 0.0]
    # Halved again and again, what is left became so small that sums with it took ten times as long.
    assert (left[:, 0] >= LEAST_HITS).all() and (left[:, 2] > 8.9).all()
    # What they took up is used again.
    taken = int(cells.used[0])
    scan = PlanarCaster(box).cast(LRF, (0, 0, 0))
    grid.add(Beams.of(scan, 0.0, noise), (0.03, 0.04))
    assert cells.used[0] == taken and (grid.cells.heads >= 0).sum() >= 2
