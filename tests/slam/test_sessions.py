import json
from dataclasses import replace

import numpy as np
import pytest
import shapely
from drives import NoMap, drive, recorded
from program import lrf3d as program
from program import told
from scipy.ndimage import binary_dilation

import lrf3d
from lrf3d.geometry.lines import wrap_angle
from lrf3d.geometry.pose import between, compose
from lrf3d.recordings.formats.carmen_writer import write_log
from lrf3d.slam.offline import solve_log
from lrf3d.slam.places.known_places import KnownPlaces
from lrf3d.world.free_cells import FreeCells

ROOMS = lrf3d.World(
    [
        *[[0, 0, 14, 0], [14, 0, 14, 9], [14, 9, 0, 9], [0, 9, 0, 0]],
        *[[6, 0, 6, 2.5], [6, 4, 6, 9], [9, 9, 9, 6], [6, 6, 7.5, 6]],
        *[[2, 5, 3, 5], [3, 5, 3, 6], [11, 2, 12, 3], [0, 7, 1.5, 7], [4, 0, 4, 1]],
    ],
    name="rooms",
)
ROUTE = [(1.5, 1.5), (5, 3.2), (8, 3.2), (10, 5), (12.5, 5), (12.5, 7.5)]
BACK = [(12, 7), (12, 5), (10, 4), (8, 3.2), (5, 3.2), (2, 3), (1.5, 6)]
ELSEWHERE = lrf3d.World(
    [[0, 0, 5, 0], [5, 0, 7, 8], [7, 8, 3, 11], [3, 11, 3, 6], [3, 6, 0, 5], [0, 5, 0, 0]],
    name="elsewhere",
)


def log_of(*parts):
    """The log of drives one after another: the robot is carried, and its wheels do not notice."""
    scans, wheels = list(parts[0][0]), parts[0][1]
    for others, turned, _ in parts[1:]:
        step, start = 0.25, scans[-1].time + 0.25
        scans += [replace(scan, time=start + step * k) for k, scan in enumerate(others)]
        wheels = np.vstack([wheels, compose(wheels[-1], between(turned[0], turned))])
    return recorded(scans, wheels)


def errors(found, *parts):
    """How far the poses are off [m], [rad], where they are known."""
    off = found.poses - np.concatenate([true for _, _, true in parts])
    return np.hypot(off[:, 0], off[:, 1])[found.known], np.abs(wrap_angle(off[:, 2]))[found.known]


@pytest.mark.parametrize("kind", ["world", pytest.param("run", marks=pytest.mark.slow)])
def test_a_drive_is_found_on_a_plan_and_on_a_map_without_a_first_pose(kind):
    known = ROOMS
    if kind == "run":
        path = lrf3d.follow_route(np.array([*ROUTE, *BACK]), dt=0.5)
        known = lrf3d.simulate(ROOMS, path, rng=0)
    part = drive(ROOMS, BACK, seed=3)
    found = lrf3d.localise_log(known, log_of(part))
    apart, turned = errors(found, part)
    (stretch,) = found.stretches
    assert stretch.first < 20 and stretch.last > len(found.poses) - 20 and not stretch.carried
    assert stretch.probability >= 0.99
    assert apart.max() < 0.2 and turned.max() < 0.05
    assert found.map_scale == 1.0


@pytest.mark.parametrize("scale", [0.96, 1.04])
def test_a_map_of_another_size_than_the_drive_is_noticed(scale):
    found = lrf3d.localise_log(ROOMS.scaled(scale), log_of(drive(ROOMS, BACK, seed=3)))
    assert len(found.stretches) == 1 and found.map_scale == pytest.approx(scale, abs=0.011)


@pytest.mark.parametrize("yaw", [0.0, 0.5])
def test_a_drive_is_found_on_cells_with_thick_walls_of_which_a_tenth_is_missing(yaw):
    plan = KnownPlaces.from_world(ROOMS)
    walls = binary_dilation(plan.occupied, iterations=2)
    walls &= np.repeat(np.random.default_rng(0).random(walls.shape[1] // 4 + 1) > 0.1, 4)[
        : walls.shape[1]
    ]
    origin = compose(np.array([0.0, 0.0, yaw]), plan.origin)
    cells = FreeCells(~walls, plan.side, tuple(origin), walls)
    part = drive(ROOMS, BACK, seed=3)
    found = lrf3d.localise_log(replace(ROOMS, free=cells), log_of(part))
    (stretch,) = found.stretches
    off = found.poses - compose(np.array([0.0, 0.0, yaw]), part[2])
    assert stretch.first == 0 and stretch.probability > 0.98
    assert np.hypot(*off[found.known, :2].T).max() < 0.3


def test_a_robot_that_is_not_on_the_map_is_found_nowhere():
    part = drive(ELSEWHERE, [(1, 1), (4, 3), (5.5, 7)], seed=1)
    found = lrf3d.localise_log(ROOMS, log_of(part))
    assert found.stretches == () and not found.known.any() and found.probability < 0.9


@pytest.mark.slow
def test_a_robot_that_is_carried_away_is_found_again():
    parts = drive(ROOMS, BACK, seed=3), drive(ROOMS, ROUTE[2:], seed=4)
    found = lrf3d.localise_log(ROOMS, log_of(*parts))
    first, second = found.stretches
    count = len(parts[0][0])
    assert first.last < count <= second.first < count + 20
    assert second.carried and not first.carried
    assert errors(found, *parts)[0].max() < 0.2


@pytest.mark.slow
def test_localise_writes_poses_and_a_picture(tmp_path):
    path, world = tmp_path / "drive.log", tmp_path / "rooms.toml"
    run = lrf3d.simulate(ROOMS, lrf3d.follow_route(np.array(BACK), dt=0.25), rng=0)
    lrf3d.export_run(run, "carmen", path)
    lrf3d.save_world(ROOMS, world)
    summary = told("localise", world, path, "--out", tmp_path / "out")
    assert summary["stretches"][0]["probability"] >= 0.99
    table = np.loadtxt(tmp_path / "out/trajectory.tum")
    assert len(table) == summary["scans_localised"] > 0.8 * len(run)
    assert np.hypot(*(table[-1, 1:3] - run.trajectory.poses[-1, :2])) < 0.1
    assert (tmp_path / "out/map.png").exists()


@pytest.mark.slow
def test_a_second_drive_continues_the_map_of_the_first(tmp_path):
    first = drive(ROOMS, [*ROUTE, *BACK[1:4]], seed=5, bias=0.0)
    second = drive(ROOMS, [*ROUTE[2:], *BACK], seed=6, bias=0.0)
    log = recorded(*second[:2], name="second")
    before = lrf3d.slam_log(recorded(*first[:2], name="first"))
    with pytest.raises(lrf3d.InputError, match="found nowhere on the map of first with certainty"):
        lrf3d.slam_log(recorded(*drive(ELSEWHERE, [(1, 1), (4, 3), (5.5, 7)])[:2]), on=before)
    lrf3d.save_run(before, tmp_path / "run.npz")
    run = lrf3d.slam_log(log, on=tmp_path)
    true = np.concatenate([first[2], second[2]])
    assert len(run) == len(true) and len(run.trajectory) == len(before) + len(log)
    # Both start where the wheels of the first say, which is where it was.
    apart = np.hypot(*(run.trajectory.poses - true)[:, :2].T)
    assert apart.max() < 0.15
    ties = run.estimate.closures
    assert ((ties[:, 0] < len(before)) & (ties[:, 1] >= len(before))).any()
    # A third one continues both.
    third = lrf3d.slam_log(recorded(*drive(ROOMS, BACK, seed=7)[:2]), on=run)
    assert len(third) > len(run) and np.allclose(third.trajectory.poses[0], true[0], atol=0.05)


@pytest.mark.slow
def test_a_drive_with_two_lasers_is_continued_and_nothing_contradicts_it(tmp_path):
    lasers = [
        lrf3d.LaserRangeFinder(-2.2, 2.2, 131, range_max=20.0, mount=mount, name=name)
        for name, mount in (("front", (0.2, 0.15, 0.5)), ("rear", (-0.2, -0.15, 0.5 - np.pi)))
    ]
    true, logs, on, out = np.empty((0, 3)), [], [], tmp_path / "out"
    for number, route in enumerate((ROUTE, BACK[1:6])):
        path = lrf3d.follow_route(np.array(route, dtype=float), speed=0.8, dt=0.25)
        noise, bag = lrf3d.ProportionalNoise(0.02), tmp_path / f"{number}.mcap"
        run = lrf3d.simulate(ROOMS, path, lasers, noise=noise, rng=number, mapper=NoMap())
        lrf3d.export_run(run, "mcap", bag)
        logs, true = [*logs, lrf3d.load_log(bag)], np.vstack([true, path.poses])
        done = program("slam", bag, *on, "--out", out)
        assert done.returncode == 0 and "warning" not in done.stderr
        assert len(np.loadtxt(out / "trajectory.tum")) == len(run)
        first, on, out = lrf3d.load_run(out), ["--on", out], tmp_path / "both"
        mounts = [np.array([lrf.mount for lrf in each]) for each in (first.lasers, lasers)]
        assert np.allclose(*mounts)
    # Each return of each laser is kept, where it was measured.
    returns = np.concatenate([scan.points() for scan in first.scans])
    walls = shapely.multilinestrings(ROOMS.segments.reshape(-1, 2, 2))
    assert len(returns) == sum(scan.hits.sum() for log in logs for scan in log.scans)
    assert np.sqrt(np.square(shapely.distance(shapely.points(returns), walls)).mean()) < 0.006
    assert np.hypot(*(first.trajectory.poses - true)[:, :2].T).max() < 0.02
    # Another robot, with one laser, goes on: all are of one laser, from the middle of each robot.
    third = lrf3d.slam_log(recorded(*drive(ROOMS, BACK[2:5], seed=7)[:2]), on=first)
    assert len(third.lasers) == 1 and len(third) > len(first)
    assert np.allclose(third.trajectory.poses[0], true[0], atol=0.05)


TWICE = [(1.5, 1.5), (5, 1.7), (5, 3.2), (1.5, 4), (1.5, 1.5), (5, 1.7), (5, 3.2), (1.5, 4)]


@pytest.mark.slow
def test_known_pairs_of_scans_close_loops_or_rule_them_out():
    scans, wheels, true = drive(ROOMS, TWICE, seed=8)
    log = recorded(scans, wheels)
    usual = solve_log(log)
    assert len(usual.run.estimate.closures)
    first, second = usual.run.estimate.closures[0].tolist()
    ruled_out = solve_log(log, apart=[(first, second)])
    assert [first, second] not in ruled_out.run.estimate.closures.tolist()
    assert "ruled out" in {each.why for each in ruled_out.slam.closer.refusals}
    # Where it is ruled out and known, it is known.
    said = solve_log(log, apart=[(first, second)], close=[(first, second)])
    assert [first, second] in said.run.estimate.closures.tolist()
    # It counts once, as certain, whatever other closures say.
    ends = said.slam.key_scans[np.column_stack([said.slam.edges[n] for n in ("first", "second")])]
    edge = (ends == [first, second]).all(axis=1)
    assert said.slam.edges["may_be_wrong"][edge].tolist() == [False]
    assert np.hypot(*(said.poses - true)[:, :2].T).max() < 0.15
    with pytest.raises(lrf3d.InputError, match="close 5:6: these scans show nothing"):
        solve_log(log, close=[(5, 6)])
    with pytest.raises(lrf3d.InputError, match="close 5:2000: expected scans from 0 to"):
        solve_log(log, close=[(5, 2000)])


@pytest.mark.slow
def test_the_place_where_a_map_contradicts_itself_is_named_and_drawn(tmp_path):
    # The robot is carried to another house, and its wheels do not notice.
    path, around = tmp_path / "drive.log", [(1, 1), (4, 3), (5.5, 7), (4, 3), (1, 2), (4, 2)]
    parts = drive(ROOMS, TWICE, seed=8), drive(ELSEWHERE, around, seed=1)
    write_log(log_of(*parts), path)
    # With a pair of scans on both sides of the lift, the drive stays in one piece.
    across = f"0:{len(parts[0][0]) + 9}"
    done = program("slam", path, "--not", across, "--out", tmp_path / "out", "--json")
    assert done.returncode == 0 and "--close A:B and --not A:B say" in done.stderr
    summary = json.loads(done.stdout)
    assert not summary["self_check"]["passed"] and (tmp_path / "out/check.png").exists()
    assert all(len(each["scans"]) == 2 and each["why"] for each in summary["refused"])


def test_a_known_pair_counts_also_where_its_later_scan_comes_after_the_last_key_scan():
    scans, wheels, true = drive(ROOMS, TWICE, seed=8)
    late = len(scans) - 1
    early = int(np.hypot(*(true[: late // 2] - true[late])[:, :2].T).argmin())
    said = solve_log(recorded(scans, wheels), close=[(early, late)])
    keys = said.slam.key_scans
    assert keys[-1] < late
    edges = said.slam.edges
    loops = edges[(edges["second"] == len(keys) - 1) & (edges["first"] < len(keys) - 2)]
    assert np.abs(keys[loops["first"]] - early).min() < 10
