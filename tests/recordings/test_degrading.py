"""Logs that are made worse on purpose."""

import numpy as np
import pytest
from program import refused, told
from synthetic_run import around, box, make_run, make_world

from lrf3d import InputError, LaserRangeFinder, LaserScan, export_run
from lrf3d.recordings import LaserLog, load_log
from lrf3d.recordings.degrade import degrade_log
from lrf3d.recordings.formats.carmen_writer import write_log
from lrf3d.recordings.log import WheelRecord


@pytest.fixture
def path(tmp_path):
    lrf = LaserRangeFinder(-1.5, 1.5, 91, range_max=40.0, mount=(0.2, 0.1, 0.3))
    run = make_run(make_world(box(0, 0, 10, 8)), around(5, 4, 2.5, 20), lrf)
    export_run(run, "carmen", tmp_path / "room.log")
    return tmp_path / "room.log"


def same(log, other):
    assert np.array_equal(log.times, other.times)
    assert np.allclose(log.poses, other.poses, rtol=0, atol=1e-12)
    assert np.allclose(log.mount, other.mount, rtol=0, atol=1e-12)
    for a, b in zip(log.scans, other.scans, strict=True):
        assert np.array_equal(a.ranges, b.ranges)
        assert np.allclose(a.angles, b.angles, rtol=0, atol=1e-12)
    if log.wheels is not None:
        for name in ("times", "poses", "places", "laser_offset"):
            assert np.array_equal(getattr(log.wheels, name), getattr(other.wheels, name))


def test_a_log_that_is_not_made_worse_is_read_back_the_same(path):
    log = load_log(path)
    write_log(degrade_log(log), path.with_name("same.log.gz"))
    same(log, load_log(path.with_name("same.log.gz")))


def test_odometry_between_scans_an_offset_and_an_unknown_range_are_read_back(tmp_path):
    angles = np.linspace(-1.0, 1.0, 5)
    ranges = [1.0, 70.0, np.inf, -np.inf, 2.5]
    mount = (0.1, 0.0, 0.0)
    scans = [LaserScan((k, 0, 0), angles, ranges, time=k + 0.5, mount=mount) for k in range(3)]
    odometry = np.array([[k / 2, 0.25, 0.0] for k in range(7)])
    wheels = WheelRecord(np.arange(7) / 2, odometry, np.array([-1, 3, 3]), 0.1)
    log = LaserLog("few", scans, wheels=wheels)
    write_log(log, tmp_path / "few.log")
    same(log, load_log(tmp_path / "few.log"))


def test_the_shares_and_the_noise_are_those_asked_for(path):
    log = load_log(path)
    worse = degrade_log(log, drop=0.3, noise=0.05, every=2, beams_every=3, rng=1)
    assert np.array_equal(worse.times, log.times[::2])
    assert np.array_equal(worse.odometry.times, log.odometry.times)
    before = np.array([scan.ranges[::3] for scan in log.scans[::2]])
    after = np.array([scan.ranges for scan in worse.scans])
    lost = np.isinf(after)
    assert lost.mean() == pytest.approx(0.3, abs=0.08)
    assert (after - before)[~lost].std() == pytest.approx(0.05, rel=0.2)


def test_the_command_reports_what_it_did(path, tmp_path):
    out = tmp_path / "new" / "worse.log.gz"
    summary = told("degrade", path, "--drop", "0.3", "--every", "2", "--out", out)
    worse = load_log(out)
    assert summary["scans"] == len(worse) == 10 and summary["returns"] == 910
    assert summary["returns"] - summary["returns_lost"] == sum(s.hits.sum() for s in worse.scans)


def test_what_cannot_be_written_is_refused(path, tmp_path):
    refused("degrade", path, "--out", path)
    refused("degrade", path, "--out", tmp_path / "worse.csv")
    refused("degrade", path, "--beams-every", "91", "--out", tmp_path / "worse.log")
    uneven = LaserLog("uneven", [LaserScan((0, 0, 0), [0.0, 0.1, 0.3], [1.0, 1.0, 1.0])])
    with pytest.raises(InputError, match="evenly spaced"):
        write_log(uneven, tmp_path / "uneven.log")
    assert not list(tmp_path.glob("*.csv")) and not (tmp_path / "uneven.log").exists()
