"""What moves, or stood for a while, leaves the map and the cells; what stays is in both."""

import numpy as np
import pytest
from map_objects import cells_of

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
from lrf3d.mapping.robust.clusters import LEAST_HITS

LRF = LaserRangeFinder(range_max=30.0)
CORRIDOR = World(np.array([[-2, -1.5, 20, -1.5], [20, -1.5, 20, 1.5], [20, 1.5, -2, 1.5]]))


def mapped(world, drive, *obstacles):
    noise, mapper = ProportionalNoise(0.02), LineMapper()
    return simulate(world, drive, LRF, noise=noise, mapper=mapper, rng=0, obstacles=obstacles)


def walked_by(speed, start):
    """The map of a drive along the corridor in which a person walks along beside the robot."""
    times = 0.25 * np.arange(60)
    drive = Trajectory(times, np.column_stack([0.7 * times, np.zeros(60), np.zeros(60)]))
    end = start + speed * times[-1]
    path = Trajectory([0.0, times[-1]], [(start, 0.8, 0.0), (end, 0.8, 0.0)])
    person = DynamicObstacle(round_outline(0.25), path)
    run = mapped(CORRIDOR, drive, person)
    return run.map.segments


@pytest.mark.parametrize(
    ("speed", "start", "most"), [(-1.0, 14.0, 0), (0.4, 2.0, 1), (-0.3, 9.0, 1)]
)
def test_who_walks_through_a_corridor_leaves_hardly_a_wall(speed, start, most):
    segments = walked_by(speed, start)
    inside = (np.abs(segments[:, [1, 3]]) < 1.3).all(axis=1) & (segments[:, [0, 2]] < 19.5).any(1)
    # Who is slow is seen longest where the robot passes by, and never again.
    assert len(segments) - inside.sum() == 3 and inside.sum() <= most


def test_who_is_slow_and_never_seen_again_leaves_few_walls():
    times = 0.25 * np.arange(80)
    drive = Trajectory(times, np.column_stack([0.8 * times, np.zeros(80), np.zeros(80)]))
    # The robot drives through them, and looks back at none.
    people = [
        DynamicObstacle(
            round_outline(0.25), Trajectory([0.0, 20.0], [(x + 1.0, y, 0.0), (x - 1.0, y, 0.0)])
        )
        for x, y in ((6.0, 0.1), (10.0, -0.1), (14.0, 0.1))
    ]
    run = mapped(CORRIDOR, drive, *people)
    # They left 22.
    assert len(run.map) - 3 <= 10


def test_what_all_beams_go_through_leaves_the_cells():
    cells = None
    box = World(np.array([[5, -1, 5, 1.0]]))
    for world, times in ((box, 3), (World(np.array([[9, -4, 9, 4.0]])), 90)):
        scan = PlanarCaster(world).cast(LRF, (0.03, 0.04, 0))
        cells = cells_of([scan] * times, 0.01, cells)
    used = cells.clusters[: cells.counters[0].clusters]
    left = used[used["hits"] > 0.0]
    # Halved again and again, what is left became so small that sums with it took ten times as long.
    assert (left["hits"] >= LEAST_HITS).all() and (left["x"] > 8.9).all()
    # What they took up is used again.
    taken = int(cells.counters[0].clusters)
    cells = cells_of([PlanarCaster(box).cast(LRF, (0.03, 0.04, 0))], 0.01, cells)
    assert cells.counters[0].clusters == taken and (cells.heads > 0).sum() >= 2
