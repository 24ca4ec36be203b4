import pickle
from dataclasses import replace

import numpy as np
import pytest
from map_objects import cells_of, objects_of

from lrf3d import LaserRangeFinder, LaserScan, LineMapper, PlanarCaster, ProportionalNoise, World
from lrf3d.geometry import lengths

LRF = LaserRangeFinder(range_max=30.0)
CIRCLE = LaserRangeFinder(angle_min=-np.pi, angle_max=np.pi, beams=361, range_max=30.0)


def drive(mapper, worlds, poses, sigma=0.02, lrf=LRF):
    rng = np.random.default_rng(0)
    for world, pose in zip(worlds, poses, strict=True):
        mapper.update(ProportionalNoise(sigma)(PlanarCaster(world).cast(lrf, pose), rng))
    return mapper.map


def seen_from(world, poses, lrf=CIRCLE):
    scans = [PlanarCaster(World(np.array(world))).cast(lrf, pose) for pose in poses]
    return cells_of(scans)


def test_an_open_door_is_not_bridged_by_what_unites_walls():
    # The door is as wide as a gap that uniting alone would close.
    walls = World(np.array([[5, -6, 5, -0.2], [5, 0.2, 5, 6], [9, -6, 9, 6.0]]))
    poses = [(0.3 * (k % 9), 0.25 * (k // 5) - 1.0, 0.0) for k in range(45)]
    line_map = drive(LineMapper(sigma=0.02), [walls] * 45, poses)
    front = line_map.segments[np.abs(line_map.segments[:, 0] - 5) < 0.3]
    assert len(front) == 2


def test_a_bent_wall_is_two_although_no_single_scan_tells():
    # From afar the bend drowns in the noise; together the scans show it.
    bent = World(np.array([[20, -5, 20.3, 0], [20.3, 0, 20, 5.0]]))
    poses = [(0.3 * k, 0.4 * k - 3.0, 0.0) for k in range(20)]
    line_map = drive(LineMapper(sigma=0.1), [bent] * 20, poses, sigma=0.1)
    assert len(line_map) == 2
    assert lengths(line_map.segments) == pytest.approx([5, 5], abs=1.2)


def test_no_beam_between_makes_one_object_and_a_beam_two():
    # Two faces of one house, and its corner hidden; a lane of 2 m in the second world.
    house = np.array([[5.0, -2.0, 5.0, 2.0], [7.0, 2.0, 11.0, 2.0]])
    whole = [*house.tolist(), [5, 2, 7, 2.0]]
    beams = seen_from(whole, [(0, 0, 0), (8, 6, 0)])
    assert len(set(objects_of(house, beams))) == 1
    lane = [[5, -3, 5, -1.0], [5, 1, 5, 3.0]]
    parted = objects_of(lane, seen_from(lane, [(0, 0, 0)]))
    assert len(set(parted)) == 2


def test_what_lies_before_a_wall_is_no_part_of_it():
    # A pillar hides a part of the wall behind it; nothing was seen between the two.
    scene = [[5, 0.5, 5, -0.5], [12, 8, 12, -8.0]]
    beams = seen_from(scene, [(0, 0, 0)])
    assert len(set(objects_of(scene, beams))) == 2


def test_what_is_kept_does_not_grow_where_all_was_seen():
    room = World(np.array([[9, -8, 9, 8], [9, 8, -9, 8], [-9, 8, -9, -8], [-9, -8, 9, -8.0]]))
    mapper, sizes = LineMapper(sigma=0.02), []
    for turn in range(3):
        poses = [(0.1 * (k % 20), 0.05 * k, 0.3 * k) for k in range(40)]
        drive(mapper, [room] * 40, poses, lrf=CIRCLE)
        if turn:
            sizes.append(len(pickle.dumps(mapper)))
    assert sizes[1] <= 1.01 * sizes[0]


def test_stretches_of_one_wall_are_bridged_where_no_beam_passed():
    # A post hides part of the wall; beside an open gap of the same width there is none.
    post = [[3, -0.35, 3, 0.35]]
    whole, open_ = [[6, -4, 6, 4.0], *post], [[6, -4, 6, -0.7], [6, 0.7, 6, 4.0], *post]
    for walls, count in ((whole, 1), (open_, 2)):
        poses = [(0, 0, 0), (0.3, 0, 0)] if walls is whole else [(0, y, 0) for y in (-1, 0, 1)]
        line_map = drive(LineMapper(), [World(np.array(walls))] * len(poses), poses)
        assert (line_map.segments[:, 0] > 5.0).sum() == count


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


def test_walls_far_apart_are_one_object_unless_a_line_of_sight_between_them_is_open():
    walls = [[0, 0, 0, 6.0], [8, 6, 8, 0.0]]
    nothing = seen_from([[50.0, 50.0, 51.0, 51.0]], [(-60.0, 0.0, 0.0)])
    assert len(set(objects_of(walls, nothing))) == 1
    # No beam crosses the shortest link, at one end; they do between the middles of the walls.
    across = seen_from([*walls, [0, 5.4, 8, 5.4]], [(4.0, -3.0, 0.0)])
    assert len(set(objects_of(walls, across))) == 2


def corridor_of(length=12.0):
    return World(np.array([[-2, -1, length, -1], [length, -1, length, 1], [length, 1, -2, 1.0]]))


def test_a_board_that_stood_before_a_standing_robot_leaves_no_wall():
    walls = corridor_of()
    board = World(np.vstack([walls.segments, [[1, -0.9, 1, 0.9]]]))
    pose, mapper = (0, 0, 0), LineMapper(sigma=0.02)
    blocked = drive(mapper, [board] * 3, [pose] * 3)
    assert (np.abs(blocked.segments[:, [0, 2]] - 1.0) < 0.1).all(axis=1).any()
    free = drive(mapper, [walls] * 60, [pose] * 60)
    alone = drive(LineMapper(sigma=0.02), [walls] * 60, [pose] * 60)
    assert len(free) == len(alone) == 3
    assert np.sort(lengths(free.segments)) == pytest.approx(
        np.sort(lengths(alone.segments)), abs=0.3
    )


def test_a_door_that_closes_and_opens_is_in_the_map_as_it_is_now():
    sides = [[5, 4, 5, 0.6], [5, -0.6, 5, -4], [9, 4, 9, -4.0]]
    open_, closed = World(np.array(sides)), World(np.array([*sides, [5, 0.6, 5, -0.6]]))
    mapper = LineMapper(sigma=0.02)
    poses = [(0.01 * k, 0.3 * np.sin(k), 0.0) for k in range(100)]
    for world, found in ((open_, 2), (closed, 1), (open_, 2)):
        walls = drive(mapper, [world] * 100, poses).segments
        assert (np.abs(walls[:, [0, 2]] - 5.0) < 0.2).all(axis=1).sum() == found


@pytest.mark.parametrize("step", [2, 3])
def test_beams_lost_regularly_cut_no_wall(step):
    walls, mapper = corridor_of(), LineMapper(sigma=0.02)
    rng = np.random.default_rng(0)
    for k in range(12):
        scan = ProportionalNoise(0.02)(PlanarCaster(walls).cast(LRF, (0.5 * k, 0, 0)), rng)
        ranges = scan.ranges.copy()
        ranges[::step] = np.inf
        mapper.update(replace(scan, ranges=ranges))
    assert len(mapper.map) == 3


def test_the_error_of_poses_makes_no_second_walls_where_it_is_known():
    room = World(np.array([[9, -8, 9, 8], [9, 8, -9, 8], [-9, 8, -9, -8], [-9, -8, 9, -8.0]]))
    rng, counts = np.random.default_rng(3), []
    deviations = np.array([0.05, 0.05, np.radians(0.5)])
    errors = rng.normal(0.0, 1.0, (40, 3)) * deviations
    for covariance in (None, np.diag(deviations**2)):
        mapper = LineMapper(sigma=0.02)
        for k, error in enumerate(errors):
            scan = PlanarCaster(room).cast(CIRCLE, (0.1 * k - 2.0, 0.05 * k, 0.2 * k))
            pose = tuple(np.array(scan.pose) + error)
            mapper.update(replace(scan, pose=pose, pose_covariance=covariance))
        counts.append(len(mapper.map))
    assert counts[1] == 4 < counts[0]


def test_a_bent_wall_that_is_merged_and_cut_settles():
    bent = World(np.array([[20, -5, 20.3, 0], [20.3, 0, 20, 5.0]]))
    poses = [(0.3 * k, 0.4 * k - 3.0, 0.0) for k in range(20)]
    mapper = LineMapper(sigma=0.1)
    drive(mapper, [bent] * 20, poses, sigma=0.1)
    maps, nothing = [], LaserScan((0, 0, 0), LRF.angles, np.full(LRF.beams, -np.inf))
    for _ in range(12):
        mapper.update(nothing)
        maps.append(mapper.map.segments)
    for other in maps[-4:]:
        assert other == pytest.approx(maps[-1], abs=0.05)
