from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import lrf3d
from lrf3d.geometry.pose import compose
from lrf3d.matching.key_scans import ScanConverter
from lrf3d.slam import checks
from lrf3d.slam.checks import doubtful_mount, doubtful_poses

PEN = lrf3d.World([[0, 0, 3, 0], [3, 0, 3, 2], [3, 2, 0, 2], [0, 2, 0, 0], [1.4, 0, 1.4, 0.8]])
SHORT = lrf3d.LaserRangeFinder(beams=91, range_max=4.0)
LAP = [(0.5, 0.5), (0.6, 1.5), (2.4, 1.5), (2.5, 0.5), (2.4, 1.5), (0.6, 1.5)]


@pytest.fixture(scope="module")
def scans():
    run = lrf3d.load_scenario("corridor").run(scans=60)
    return [run.scan(number) for number in range(len(run))]


@pytest.mark.parametrize("sense", [1.0, -1.0])
@pytest.mark.parametrize("turn", [0.0, 30.0, 180.0, -90.0])
def test_a_laser_that_is_mounted_otherwise_than_declared_is_named(turn, sense, scans):
    declared = lrf3d.Pose(0.0, 0.0, -np.radians(turn))
    changed = [
        replace(each, angles=sense * each.angles, pose=each.pose @ declared, mount=declared)
        for each in scans
    ]
    doubt = doubtful_mount(changed) or ""
    assert (f"turned by {turn:.0f}°" in doubt) == (turn != 0.0)
    assert ("mirrored" in doubt) == (sense < 0.0)


@pytest.mark.parametrize(
    ("changed", "reason"),
    [
        (lambda pose, k: pose, ""),
        (
            lambda pose, k: lrf3d.Pose(1e3 * pose.x, 1e3 * pose.y, pose.theta),
            "contradict the scans",
        ),
        (lambda pose, k: lrf3d.Pose(pose.x + 30.0 * (k > 30), pose.y, pose.theta), "jump by 30"),
        (lambda pose, k: lrf3d.Pose(0.0, 0.0, 0.0), "stay at one place"),
    ],
)
def test_poses_that_do_not_fit_the_scans_are_named(changed, reason, scans):
    moved = [replace(each, pose=changed(each.pose, k)) for k, each in enumerate(scans)]
    doubt = doubtful_poses(moved)
    assert reason in (doubt or "") and bool(doubt) == bool(reason)


def test_poses_of_another_drive_are_named_in_a_small_pen():
    poses = lrf3d.follow_route(np.array([*LAP, *LAP]), speed=0.5, dt=0.4).poses
    taken = [lrf3d.PlanarCaster(PEN).cast(SHORT, pose) for pose in poses]
    foreign = [
        replace(scan, pose=lrf3d.Pose(*pose)) for scan, pose in zip(taken, poses[::-1], strict=True)
    ]
    assert doubtful_mount(foreign) is None and doubtful_poses(taken) is None
    assert "contradict the scans" in (doubtful_poses(foreign) or "")


def test_right_poses_along_plain_walls_are_not_doubted():
    walls = lrf3d.World([[0, 0, 60, 0], [60, 0, 60, 2], [60, 2, 0, 2], [0, 2, 0, 0]])
    lrf = lrf3d.LaserRangeFinder(beams=181, range_max=8.0)
    poses = [lrf3d.Pose(10.0 + 0.3 * k, 1.0, 0.0) for k in range(50)]
    assert doubtful_poses([lrf3d.PlanarCaster(walls).cast(lrf, each) for each in poses]) is None


def test_parts_of_a_turn_are_compared_with_their_like(scans):
    caster = lrf3d.PlanarCaster(lrf3d.load_scenario("corridor").world)
    places = np.array([scan.pose for scan in scans])
    parts = []
    for number in range(480):
        share = number / 8
        pose = [np.interp(share, np.arange(60.0), each) for each in places.T]
        begin = -np.pi + np.pi / 3 * (number % 6)
        field = lrf3d.LaserRangeFinder(begin, begin + np.pi / 3, 60)
        parts.append(caster.cast(field, pose))
    assert doubtful_poses(parts) is None


@pytest.mark.parametrize(
    ("declared", "turned", "named"),
    # The last is another drive's: scans fit hardly better than if the robot had stood.
    [
        (0.015, 0.005, False), (0.025, 0.005, False), (0.029, 0.005, True),
        (1.5, 0.48, True), (1.5, 0.52, False),
    ],
)  # fmt: skip
def test_a_mount_is_named_only_where_it_fits_clearly_better(
    declared, turned, named, scans, monkeypatch
):
    def apart(one, other, turns=(None,), sense=None):
        return [{(0, 1): declared, (90, 1): turned}.get((turn, sense), 1.0) for turn in turns]

    monkeypatch.setattr(checks, "_distances", apart)
    assert ("turned by 90" in (doubtful_mount(scans) or "")) == named


@pytest.mark.parametrize(
    ("count", "share", "first", "last"), [(30, 0.5, 60, 250), (10, 0.0, 10, 90)]
)
def test_the_worst_part_of_a_drive_is_that_whose_beams_pass_most(
    count, share, first, last, monkeypatch
):
    keys = [SimpleNamespace(scan=10 * number) for number in range(count)]
    through = {10 * number: 5 for number in range(6, 26)}
    found = monkeypatch.setattr
    found(checks, "seen_through_both", lambda olds, key, poses: (through.get(key.scan, 0), 10))
    check = checks.self_check(keys, np.zeros((count, 3)), 25.0 * np.arange(count), 0.01)
    assert check.violation == pytest.approx(0.5 * len(keys[6:26]) / (count - 1))
    assert (check.worst_violation, check.worst_scans) == (share, (first, last))
    assert check.key_scans_compared == count - 1


@pytest.mark.parametrize(("turned", "said"), [(0.0, ""), (0.4, "the map contradicts itself")])
def test_in_a_small_pen_a_wrong_map_is_named_after_a_few_metres(turned, said):
    poses = lrf3d.follow_route(np.array([*LAP, *LAP]), speed=0.5, dt=1.0).poses
    keys = [ScanConverter().candidate(lrf3d.PlanarCaster(PEN).cast(SHORT, each)) for each in poses]
    driven = np.linspace(0.0, 16.0, len(keys))
    claimed = compose(np.array([0.0, 0.0, turned]), poses)
    claimed = np.where((driven < 8.0)[:, None], poses, claimed)
    check = checks.self_check(keys, claimed, driven)
    assert check.key_scans_compared > 3
    assert [each.split(":")[0] for each in check.sentences()] == [said] * bool(said)
