"""What the evidence of all beams makes of walls: bridged, cut, made longer, forgotten."""

import pickle
from dataclasses import replace

import numpy as np
import pytest
from map_objects import CIRCLE, cells_of, map_of, objects_of, scans_of
from synthetic_run import box

from lrf3d import (
    DynamicObstacle,
    LaserRangeFinder,
    LaserScan,
    LineMapper,
    PlanarCaster,
    ProportionalNoise,
    Trajectory,
    World,
    simulate,
)
from lrf3d.casting.dynamic_obstacle import round_outline
from lrf3d.geometry.lines import lengths
from lrf3d.laser import RangeNoise
from lrf3d.mapping.robust.extraction import END_DEVIATIONS, LikelihoodExtractor
from lrf3d.mapping.robust.rays import LEAST_HITS

LRF = LaserRangeFinder(range_max=30.0)
ROOM = World(box(-9, -8, 18, 16))
BENT = (
    World(np.array([[20, -5, 20.3, 0], [20.3, 0, 20, 5.0]])),
    [(0.3 * k, 0.4 * k - 3.0, 0.0) for k in range(20)],
)


def corridor(length=12.0, half=1.0):
    walls = [[-2, -half, length, -half], [length, -half, length, half], [length, half, -2, half]]
    return World(np.array(walls))


def drive(mapper, world, poses, sigma=0.02, lrf=LRF):
    return map_of(scans_of(world, poses, lrf, sigma), mapper)


def seen_from(world, poses):
    return cells_of([PlanarCaster(World(np.array(world))).cast(CIRCLE, pose) for pose in poses])


def test_an_open_door_is_not_bridged_by_what_unites_walls():
    # The door is as wide as a gap that uniting alone would close.
    walls = World(np.array([[5, -6, 5, -0.2], [5, 0.2, 5, 6], [9, -6, 9, 6.0]]))
    poses = [(0.3 * (k % 9), 0.25 * (k // 5) - 1.0, 0.0) for k in range(45)]
    line_map = drive(LineMapper(sigma=0.02), walls, poses)
    assert (np.abs(line_map.segments[:, 0] - 5) < 0.3).sum() == 2


def test_a_bent_wall_is_two_although_no_single_scan_shows_it_and_settles():
    # From afar the bend drowns in the noise; together the scans show it.
    mapper = LineMapper(sigma=0.1)
    found = drive(mapper, *BENT, sigma=0.1).segments
    assert lengths(found) == pytest.approx([5, 5], abs=1.2)
    maps, nothing = [], LaserScan((0, 0, 0), LRF.angles, np.full(LRF.beams, -np.inf))
    for _ in range(12):
        maps.append(map_of([nothing], mapper).segments)
    for other in maps[-4:]:
        assert other == pytest.approx(maps[-1], abs=0.05)


HOUSE, HIDDEN = [[5.0, -2, 5, 2], [7.0, 2, 11, 2]], [5.0, 2, 7, 2]
LANE, PILLAR = [[5, -3, 5, -1.0], [5, 1, 5, 3.0]], [[5, 0.5, 5, -0.5], [12, 8, 12, -8.0]]
FAR = [[0, 0, 0, 6.0], [8, 6, 8, 0.0]]


@pytest.mark.parametrize(
    ("walls", "world", "poses", "objects"),
    [
        # Two faces of one house, and its corner hidden; a lane of 2 m.
        (HOUSE, [*HOUSE, HIDDEN], [(0, 0, 0), (8, 6, 0)], 1),
        (LANE, LANE, [(0, 0, 0)], 2),
        # A pillar hides a part of the wall behind it; nothing was seen between the two.
        (PILLAR, PILLAR, [(0, 0, 0)], 2),
        # Far apart, and no beam between them.
        (FAR, [[50.0, 50.0, 51.0, 51.0]], [(-60.0, 0.0, 0.0)], 1),
        # No beam crosses the shortest link, at one end; they do between the middles of the walls.
        (FAR, [*FAR, [0, 5.4, 8, 5.4]], [(4.0, -3.0, 0.0)], 2),
    ],
)
def test_walls_are_one_object_unless_a_beam_passed_between_them(walls, world, poses, objects):
    assert len(set(objects_of(walls, seen_from(world, poses)))) == objects


@pytest.mark.parametrize("step", ["walls_to_refit", "replace_walls", "link_walls"])
def test_a_mapper_goes_on_after_an_interrupted_update(step, monkeypatch):
    def interrupted(*_):
        raise KeyboardInterrupt

    poses = [(0.1 * k, 0.05 * k, 0.3 * k) for k in range(30)]
    mapper, whole = LineMapper(), drive(None, ROOM, poses[:10] + poses[11:], lrf=CIRCLE)
    drive(mapper, ROOM, poses[:10], lrf=CIRCLE)
    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(f"lrf3d.mapping.robust.mapper.{step}", interrupted)
        drive(mapper, ROOM, poses[10:11], lrf=CIRCLE)
    found = drive(mapper, ROOM, poses[11:], lrf=CIRCLE)
    assert len(found) == len(whole) == 4 and found.object_count == 1
    assert np.sort(lengths(found.segments)) == pytest.approx(
        np.sort(lengths(whole.segments)), abs=0.05
    )


def test_what_is_kept_does_not_grow_where_all_was_seen():
    mapper, sizes = LineMapper(sigma=0.02), []
    for _ in range(3):
        drive(mapper, ROOM, [(0.1 * (k % 20), 0.05 * k, 0.3 * k) for k in range(40)], lrf=CIRCLE)
        sizes.append(len(pickle.dumps(mapper)))
    assert sizes[2] <= 1.01 * sizes[1]


def test_stretches_of_one_wall_are_bridged_where_no_beam_passed():
    # A post hides part of the wall; beside an open gap of the same width there is none.
    post = [3, -0.35, 3, 0.35]
    for walls, poses, count in (
        ([[6, -4, 6, 4.0], post], [(0, 0, 0), (0.3, 0, 0)], 1),
        ([[6, -4, 6, -0.7], [6, 0.7, 6, 4.0], post], [(0, y, 0) for y in (-1, 0, 1)], 2),
    ):
        assert (drive(None, World(np.array(walls)), poses).segments[:, 0] > 5.0).sum() == count


def test_single_beams_make_a_wall_longer():
    # One scan shows half of the wall; of the other half each scan meets one place.
    wall = World(np.array([[5, -3, 5, 3.0]]))
    mapper, ends = LineMapper(), []
    for k in range(12):
        scan = PlanarCaster(wall).cast(CIRCLE, (0.0, 0.3 * k, 0.0))
        places = scan.pose.y + 5.0 * np.tan(scan.angles)
        kept = places < 0.0 if k == 0 else np.abs(places - 0.16 * k) < 0.04
        # Too near to be measured: nothing is known along these beams.
        mapper.update(replace(scan, ranges=np.where(kept, scan.ranges, -np.inf)))
        ends.append(mapper.map.segments[:, [1, 3]].max())
    assert len(mapper.map) == 1
    assert ends[0] < 0.0 and ends[-1] > 1.3


def test_a_board_that_stood_before_a_standing_robot_leaves_no_wall():
    walls, mapper = corridor(), LineMapper(sigma=0.02)
    board = World(np.vstack([walls.segments, [[1, -0.9, 1, 0.9]]]))
    blocked = drive(mapper, board, [(0, 0, 0)] * 3)
    assert (np.abs(blocked.segments[:, [0, 2]] - 1.0) < 0.1).all(axis=1).any()
    free = drive(mapper, walls, [(0, 0, 0)] * 60)
    alone = drive(LineMapper(sigma=0.02), walls, [(0, 0, 0)] * 60)
    found, expected = (np.sort(lengths(each.segments)) for each in (free, alone))
    assert len(expected) == 3 and found == pytest.approx(expected, abs=0.3)


def test_a_door_that_closes_and_opens_is_in_the_map_as_it_is_now():
    sides = [[5, 4, 5, 0.6], [5, -0.6, 5, -4], [9, 4, 9, -4.0]]
    open_, closed = World(np.array(sides)), World(np.array([*sides, [5, 0.6, 5, -0.6]]))
    mapper = LineMapper(sigma=0.02)
    poses = [(0.01 * k, 0.3 * np.sin(k), 0.0) for k in range(100)]
    for world, found in ((open_, 2), (closed, 1), (open_, 2)):
        walls = drive(mapper, world, poses).segments
        assert (np.abs(walls[:, [0, 2]] - 5.0) < 0.2).all(axis=1).sum() == found


@pytest.mark.parametrize("step", [2, 3])
def test_beams_lost_regularly_cut_no_wall(step):
    caster, rng, mapper = PlanarCaster(corridor()), np.random.default_rng(0), LineMapper(sigma=0.02)
    for k in range(12):
        scan = ProportionalNoise(0.02)(caster.cast(LRF, (0.5 * k, 0, 0)), rng)
        lost = np.arange(LRF.beams) % step == 0
        mapper.update(replace(scan, ranges=np.where(lost, np.inf, scan.ranges)))
    assert len(mapper.map) == 3


def test_the_error_of_poses_makes_no_second_walls_where_it_is_known():
    deviations, counts = np.array([0.05, 0.05, np.radians(0.5)]), []
    errors = np.random.default_rng(3).normal(0.0, 1.0, (40, 3)) * deviations
    for covariance in (None, np.diag(deviations**2)):
        mapper = LineMapper(sigma=0.02)
        for k, error in enumerate(errors):
            scan = PlanarCaster(ROOM).cast(CIRCLE, (0.1 * k - 2.0, 0.05 * k, 0.2 * k))
            pose = tuple(np.array(scan.pose) + error)
            mapper.update(replace(scan, pose=pose, pose_covariance=covariance))
        counts.append(len(mapper.map))
    assert counts[1] == 4 < counts[0]


def test_a_noisy_end_is_moved_no_farther_than_its_noise_explains():
    # As near as this, noise makes beams run along the wall that is fitted, or away from it.
    angles, sigma, unmoved = np.linspace(0.5, 1.57, 41), 0.2, 0
    units = np.column_stack([np.cos(angles), np.sin(angles)])
    extract = LikelihoodExtractor(20.0, sigma, 0.0)
    for seed in range(300):
        noise = np.random.default_rng(seed).normal(0.0, sigma, 41)
        ranges = np.abs(0.1 / units[:, 1] + noise)
        found = extract.walls(LaserScan((0, 0, 0), angles, ranges), 0.0, RangeNoise(sigma, 0.0))
        apart = found.ends.reshape(-1, 2)[:, None] - ranges[:, None] * units
        off = np.hypot(apart[..., 0], apart[..., 1]).min(axis=1)
        assert (off <= END_DEVIATIONS * sigma).all()
        unmoved += np.count_nonzero(off < 1e-12)
    assert unmoved


# Dynamic obstacles


def walked_by(speed, paths, count=60):
    """The map of a drive along a corridor in which people walk, each from x to x at a y."""
    times = 0.25 * np.arange(count)
    poses = np.column_stack([speed * times, np.zeros(count), np.zeros(count)])
    people = [
        DynamicObstacle(round_outline(0.25), Trajectory(times[[0, -1]], [(a, y, 0.0), (b, y, 0.0)]))
        for a, b, y in paths
    ]
    noise = ProportionalNoise(0.02)
    world, route = corridor(20.0, 1.5), Trajectory(times, poses)
    return simulate(world, route, LRF, noise=noise, rng=0, obstacles=people).map.segments


@pytest.mark.parametrize(
    ("start", "end", "most"), [(14.0, -0.75, 0), (2.0, 7.9, 1), (9.0, 4.575, 1)]
)
def test_who_walks_through_a_corridor_leaves_hardly_a_wall(start, end, most):
    segments = walked_by(0.7, [(start, end, 0.8)])
    inside = (np.abs(segments[:, [1, 3]]) < 1.3).all(axis=1) & (segments[:, [0, 2]] < 19.5).any(1)
    # Who is slow is seen longest where the robot passes by, and never again.
    assert len(segments) - inside.sum() == 3 and inside.sum() <= most


def test_who_is_slow_and_never_seen_again_leaves_few_walls():
    # The robot drives through them, and looks back at none. They left 22.
    people = [(x + 1.0, x - 0.975, y) for x, y in ((6.0, 0.1), (10.0, -0.1), (14.0, 0.1))]
    assert len(walked_by(0.8, people, 80)) - 3 <= 10


def test_what_all_beams_go_through_leaves_the_cells():
    box_, cells = World(np.array([[5, -1, 5, 1.0]])), None
    for world, times in ((box_, 3), (World(np.array([[9, -4, 9, 4.0]])), 90)):
        scan = PlanarCaster(world).cast(LRF, (0.03, 0.04, 0))
        cells = cells_of([scan] * times, 0.01, cells)
    taken = int(cells.counters[0].clusters)
    used = cells.clusters[:taken]
    left = used[used["hits"] > 0.0]
    # Halved again and again, what is left became so small that sums with it took ten times as long.
    assert (left["hits"] >= LEAST_HITS).all() and (left["x"] > 8.9).all()
    # What they took up is used again.
    cells = cells_of([PlanarCaster(box_).cast(LRF, (0.03, 0.04, 0))], 0.01, cells)
    assert cells.counters[0].clusters == taken and (cells.heads > 0).sum() >= 2
