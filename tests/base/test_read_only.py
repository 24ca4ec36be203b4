"""Arrays that values hand out cannot be written to, and are not those of whoever made them."""

import copy
import pickle

import numpy as np
import pytest

import lrf3d
from lrf3d import (
    DynamicObstacle,
    KnownLines,
    LaserRangeFinder,
    LaserScan,
    LineMap,
    Trajectory,
    World,
)
from lrf3d.slam.places import PoseEstimate, Track

WALLS = [[0, 0, 10, 0], [10, 0, 10, 8], [10, 8, 0, 8], [0, 8, 0, 0.0]]
POSES = [[2.0, 2.0, 0.0], [3.0, 2.0, 0.1], [4.0, 2.0, 0.2]]
LRF = LaserRangeFinder(beams=31)


def make_run():
    noise = lrf3d.ProportionalNoise(0.04)
    return lrf3d.simulate(World(WALLS), np.array(POSES), LRF, noise=noise, rng=0)


VALUES = {
    "world": (lambda: World(WALLS), ("lines", "bounds", "origin")),
    "range finder": (lambda: LaserRangeFinder(beams=31), ("angles", "fan")),
    "scan": (lambda: LaserScan((1, 2, 3), np.zeros(3), np.ones(3)), ("hits",)),
    "embree scan": (lambda: lrf3d.EmbreeCaster(World(WALLS)).cast(LRF, POSES[0]), ("hits",)),
    "trajectory": (lambda: Trajectory([0, 1, 2], POSES), ("speeds",)),
    "trajectory of tiny numbers": (lambda: Trajectory([0, 1], [[1e-200, 0, 0], [1, 0, 0]]), ()),
    "map": (lambda: LineMap(np.array(WALLS), np.zeros(4), np.full(4, 9)), ("lines",)),
    "built map": (lambda: make_run().map, ("segments", "lines")),
    "run": (make_run, ("map",)),
    "run's scan": (lambda: make_run().scan(1), ("hits",)),
    "obstacle": (
        lambda: DynamicObstacle([[0, 0], [1, 0], [1, 1]], Trajectory([0], POSES[:1])),
        ("reach",),
    ),
    "estimate": (lambda: PoseEstimate((0, 0, 0), np.eye(3)), ()),
    "track": (lambda: Track(POSES, np.zeros((3, 3, 3)), [1, 2, 3], [4, 5, 6]), ()),
    "known lines": (lambda: KnownLines.from_world(World(WALLS)), ()),
    "scenario": (lambda: lrf3d.load_scenario("city"), ()),
}


def arrays_in(value, seen=None):
    """All arrays that can be reached from a value."""
    seen = set() if seen is None else seen
    if id(value) in seen:
        return
    seen.add(id(value))
    if isinstance(value, np.ndarray):
        yield value
    elif isinstance(value, tuple | list):
        for part in value:
            yield from arrays_in(part, seen)
    elif hasattr(value, "__dict__") and type(value).__module__.startswith("lrf3d"):
        yield from arrays_in(list(vars(value).values()), seen)


@pytest.mark.parametrize("name", VALUES)
def test_arrays_of_values_and_of_their_copies_are_read_only(name):
    make, cached = VALUES[name]
    value = make()
    for made in [lambda v: v, copy.copy, copy.deepcopy, lambda v: pickle.loads(pickle.dumps(v))]:
        other = made(value)
        for attribute in cached:
            getattr(other, attribute)
        found = list(arrays_in(other))
        assert found and not any(array.flags.writeable for array in found)


def test_what_a_caller_writes_later_changes_no_value():
    walls, ranges = np.array(WALLS), np.ones(3)
    view = ranges[:]
    view.flags.writeable = False
    times, poses = np.arange(3.0), np.array(POSES)
    world, scan = World(walls), LaserScan((0, 0, 0), np.zeros(3), view)
    trajectory, line_map = Trajectory(times, poses), LineMap(walls, np.arange(4), np.arange(4))
    for array in (walls, ranges, times, poses):
        array[:] = -5.0
    assert world.segments.tolist() == line_map.segments.tolist() == WALLS
    assert scan.ranges.tolist() == [1, 1, 1]
    assert trajectory.times.tolist() == [0, 1, 2] and trajectory.poses.tolist() == POSES


def test_a_noise_and_a_mapper_that_write_in_place_cannot_change_the_truth():
    def shifted(scan, rng):
        scan.ranges[:] += 0.5
        return scan

    class Zeroing:
        def update(self, scan):
            scan.ranges[:] = 0.0

    for settings in ({"noise": shifted}, {"mapper": Zeroing()}):
        with pytest.raises(ValueError, match="read-only"):
            next(iter(lrf3d.Simulation(World(WALLS), np.array(POSES), LRF, **settings)))
