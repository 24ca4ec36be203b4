import gzip
import re
from math import inf, pi

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from synthetic_run import around, box, make_run, make_world

from lrf3d import InputError, LaserRangeFinder, export_run, map_log, simulate
from lrf3d.geometry.lines import wrap_angle
from lrf3d.recordings import LaserLog, load_log


def front(readings, pose=(1.0, -2.0, 0.5), time=3.25):
    x, y, theta = pose
    ranges = " ".join(map(str, readings))
    return f"FLASER {len(readings)} {ranges} {x} {y} {theta} 9 9 9 {time} host 7.5"


def robot(readings, *, start=-1.0, step=0.5, farthest=30.0, remissions=()):
    ranges, strengths = " ".join(map(str, readings)), " ".join(map(str, remissions))
    return (
        f"ROBOTLASER1 0 {start} 2.0 {step} {farthest} 0.01 0 {len(readings)} {ranges}"
        f" {len(remissions)} {strengths} 4 5 0.25 8 8 8 0 0 0.3 0.3 0 6.5 host 7.5"
    )


def write(path, *lines):
    text = "\n".join(lines) + "\n"
    if path.suffix == ".gz":
        path.write_bytes(gzip.compress(text.encode("utf-8", "surrogateescape")))
    else:
        path.write_text(text, errors="surrogateescape")
    return path


def test_poses_ranges_and_times_are_as_logged(tmp_path):
    lines = ["# a comment", "PARAM robot_width 0.6 h 0", front([1, 2.5, 81.91, 50, 0])]
    log = load_log(write(tmp_path / "a.log", *lines, front([2, 2, 2], (0, 0, 4.0), 5)))
    assert isinstance(log, LaserLog) and log.name == "a"
    assert log.bad_count == 0 and log.bad_lines == ()
    assert log.scans[0].ranges.tolist() == [1.0, 2.5, inf, inf, -inf]
    assert log.scans[0].pose == (1.0, -2.0, 0.5)
    assert log.scans[1].pose.theta == pytest.approx(4.0 - 2 * pi)
    assert log.times.tolist() == [3.25, 5.0]
    assert log.poses.shape == (2, 3)


@given(st.integers(2, 400))
def test_an_odd_fan_reaches_both_sides_and_an_even_one_leaves_the_last_out(tmp_path_factory, count):
    path = tmp_path_factory.mktemp("fan") / "a.log"
    angles = load_log(write(path, front([1] * count))).scans[0].angles
    assert angles[0] == -pi / 2
    if count % 2:
        assert angles == pytest.approx(np.linspace(-pi / 2, pi / 2, count))
    else:
        assert angles == pytest.approx(-pi / 2 + np.arange(count) * pi / count)


def test_the_new_message_has_its_angles_and_its_range(tmp_path):
    scan = load_log(write(tmp_path / "a.log", robot([1, 29.9, 30.0], remissions=(5, 6)))).scans[0]
    assert scan.angles.tolist() == [-1.0, -0.5, 0.0]
    assert scan.ranges.tolist() == [1.0, 29.9, inf]
    assert scan.pose == (4.0, 5.0, 0.25) and scan.time == 6.5


def test_a_scan_in_both_messages_is_read_once(tmp_path):
    lines = [front([1, 2, 3]), robot([1, 2, 3]), front([4, 5, 6])]
    log = load_log(write(tmp_path / "a.log", *lines))
    assert [scan.ranges[0] for scan in log.scans] == [1.0, 4.0]


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        (front([1, 2, 3])[:-20], "words"),
        ("FLASER", "readings"),
        ("FLASER 99999999999999999999 1", "words"),
        (front([1, "2,5", 3]), "reading '2,5'"),
        (front([1, 2, 3], pose=("inf", 0, 0)), "x is 'inf'"),
        (front([1, 2, 3], pose=("1e300", 0, 0)), "at most 1e+09"),
        (robot([1, 2, 3], farthest="1e308"), "at most 1e+09"),
        (robot([1, 2, 3]) + " 4", "28 words, expected 27"),
        (robot([1, 2, 3], step=0.0), "rad apart"),
        ("\x00\x01junk", "not a CARMEN message"),
        ("ODOM 1 2 0.5 0 0 0 2.0 host", "9 words"),
        ("ODOM 1 nan 0.5 0 0 0 2.0 host 1", "y is 'nan'"),
        ("PARAM robot_frontlaser_offset 400 0 h 0", "robot_frontlaser_offset 400 m"),
    ],
)
def test_a_bad_line_is_named_and_the_others_are_read(line, reason, tmp_path):
    good = robot if line.startswith("ROBOT") else front
    log = load_log(write(tmp_path / "a.log", good([1, 2]), line, good([3, 4])))
    (bad,) = log.bad_lines
    assert bad.number == 2 and reason in bad.reason
    assert [scan.ranges[0] for scan in log.scans] == [1.0, 3.0]
    assert "\n" not in str(bad) and len(str(bad)) < 150


def test_all_bad_lines_are_counted_and_the_first_few_named(tmp_path):
    lines = [front([1, 2])] + ["FLASER 2 1"] * 100
    log = load_log(write(tmp_path / "a.log.gz", *lines))
    assert len(log) == 1 and log.bad_count == 100
    assert [bad.number for bad in log.bad_lines] == [2, 3, 4, 5, 6]


def test_an_endless_line_does_not_hide_what_follows(written):
    path = written("a.log", b"FLASER 2 " + b"1 " * 3_000_000 + b"\n" + front([1, 2]).encode())
    log = load_log(path)
    assert len(log) == 1 and log.bad_count > 0


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("no.log", "no such file"),
        ("picture.png", "no lines of numbers"),
        ("junk.log", "no laser scan in it.*bad lines, first line 1"),
    ],
)
def test_a_file_that_is_no_log_is_refused(tmp_path, name, said):
    (tmp_path / "picture.png").write_text("")
    (tmp_path / "junk.log").write_bytes(bytes(range(256)) * 10)
    with pytest.raises(InputError, match=f"{re.escape(name)}: {said}"):
        load_log(tmp_path / name)


@pytest.fixture(scope="module")
def run():
    world = make_world(box(0, 0, 10, 8), box(4.5, 3.5, 1, 1))
    lrf = LaserRangeFinder(range_min=0.05, range_max=5.3, beams=91)
    # Half a metre from a wall, too.
    return make_run(world, around(5, 4, 3.5, 12, heading=np.pi / 2), lrf, sigma=0.02)


@pytest.mark.parametrize("name", ["run.log", "run.log.gz"])
@pytest.mark.parametrize("poses", ["auto", "odom", "truth"])
def test_what_goes_out_comes_back_to_the_last_bit(run, name, poses, tmp_path):
    export_run(run, "carmen", tmp_path / name)
    log = load_log(tmp_path / name, poses=poses)
    assert log.bad_count == 0 and np.array_equal(log.times, run.trajectory.times)
    for before, after in zip(run.scans, log.scans, strict=True):
        heading = wrap_angle(before.pose.theta)
        assert after.pose[:2] == before.pose[:2]
        assert after.pose.theta == pytest.approx(heading, abs=0 if poses == "auto" else 1e-15)
        told = np.where(before.ranges > 5.3, inf, before.ranges)
        assert np.array_equal(after.ranges, told)
        assert after.angles == pytest.approx(before.angles, abs=1e-15)
        assert after.range_max == 5.3


def test_a_run_is_written_in_three_well_formed_messages(run, tmp_path):
    export_run(run, "carmen", tmp_path / "run.log", every=5)
    lines = (tmp_path / "run.log").read_text().splitlines()
    told = [line.split()[0] for line in lines if not line.startswith("#")]
    assert told == ["TRUEPOS", "ODOM", "ROBOTLASER1"] * 3
    log = load_log(tmp_path / "run.log")
    assert log.bad_count == 0 and len(log) == 3


@pytest.mark.parametrize("lrf", [(-2.0, 2.0, 31), (0.0, 0.0, 1)])
def test_any_fan_is_written(lrf, tmp_path):
    world, lrf = make_world(box(0, 0, 10, 8)), LaserRangeFinder(*lrf, range_max=30.0)
    run = simulate(world, around(5, 4, 2.0, 3), lrf, rng=0)
    export_run(run, "carmen", tmp_path / "run.log")
    words = [line.split()[0] for line in (tmp_path / "run.log").read_text().splitlines()]
    assert "FLASER" not in words and words.count("ROBOTLASER1") == 3
    if lrf.beams > 1:
        assert load_log(tmp_path / "run.log").scans[0].angles == pytest.approx(lrf.angles)


def test_the_same_run_is_the_same_file(run, tmp_path):
    for name in ("a.log.gz", "b.log.gz"):
        export_run(run, "carmen", tmp_path / name)
    assert (tmp_path / "a.log.gz").read_bytes() == (tmp_path / "b.log.gz").read_bytes()
    with pytest.raises(InputError, match=r"ends in \.log\.gz"):
        export_run(run, "carmen", tmp_path / "run.txt")
    with pytest.raises(InputError, match="expected one of carmen"):
        export_run(run, "bag", tmp_path / "run.bag")


def test_poses_of_odometry_and_of_the_truth_are_taken_at_the_time_of_the_scan(tmp_path):
    lines = [
        "ODOM 1 2 0.5 0.1 0.2 0 2.0 host 2.0",
        "TRUEPOS 5 6 0.25 0 0 0 2.0 host 2.0",
        front([1, 2, 3], time=3.0),
        front([1, 2, 3], time=9.0),
        "TRUEPOS 6 7 0.75 0 0 0 4.0 host 4.0",
        "ODOM 3 2 0.5 0.1 0.2 0 4.0 host 4.0",
        "ODOM 9 9 9 0 0 0 4.0 host 4.0",
    ]
    path = write(tmp_path / "a.log", *lines)
    assert len(load_log(path)) == 2 and load_log(path).scans[0].pose == (1.0, -2.0, 0.5)
    odometry, truth = load_log(path, poses="odom"), load_log(path, poses="truth")
    assert odometry.poses == pytest.approx(np.array([[2, 2, 0.5]]))
    assert truth.poses == pytest.approx(np.array([[5.5, 6.5, 0.5]]))
    assert odometry.notes[-1] == "1 scan before or after the ODOM messages left out"
    assert odometry.source == "ODOM messages" and truth.source == "TRUEPOS messages"
    with pytest.raises(InputError, match="no poses from tf in it; there are auto, odom, truth"):
        load_log(path, poses="tf")
    with pytest.raises(InputError, match="no scan within the time"):
        load_log(write(tmp_path / "b.log", *lines[:2], lines[3]), poses="odom")
    with pytest.raises(InputError, match="expected one of auto"):
        load_log(path, poses="gps")


def test_readings_beyond_the_messages_range_or_a_given_one_are_no_return(tmp_path):
    path = write(tmp_path / "a.log", robot([60.0, 79.0, 80.0], farthest=80.0))
    assert load_log(path).scans[0].ranges.tolist() == [60.0, 79.0, inf]
    assert load_log(path, largest_range=70.0).scans[0].ranges.tolist() == [60.0, inf, inf]
    with pytest.raises(InputError, match="largest range"):
        load_log(path, largest_range=-1.0)


def test_raw_odometry_is_kept_line_by_line_with_the_places_of_the_scans(tmp_path):
    def odom(x, time):
        return f"ODOM {x} 0 0 0 0 0 {time} host {time}"

    scan = front([1, 2, 3])
    lines = ["PARAM robot_frontlaser_offset -0.04 0 h 0", scan, odom(0, 5), odom(1, 4)]
    wheels = load_log(write(tmp_path / "a.log", *lines, scan, odom(2, 4), scan)).wheels
    assert wheels.poses[:, 0].tolist() == [0.0, 1.0, 2.0]
    assert wheels.times.tolist() == [5.0, 4.0, 4.0]
    assert wheels.places.tolist() == [-1, 1, 2]
    assert wheels.laser_offset == -0.04
    assert load_log(write(tmp_path / "b.log", scan)).wheels is None
    raw = "RAWLASER1 0 -1 2 1 20 0 0 3 1 2 3 0 6 host 6"
    ahead = load_log(write(tmp_path / "c.log", *lines[:1], odom(2, 5), raw, odom(3, 7)))
    # Between lines that lie far apart, the robot goes on moving.
    assert ahead.poses[0].tolist() == [2.46, 0.0, 0.0] and ahead.scans[0].robot == (2.5, 0.0, 0.0)
    truth = "TRUEPOS 7 0 0 7 0 0 5.9 host 5.9"
    for before, place, x in (([odom(1, 5.9)], 1, 2.0), ([], 0, 2.0), ([truth], -1, 7.0)):
        log = load_log(write(tmp_path / "d.log", *before, raw, odom(2, 6), odom(3, 6.1)))
        assert log.poses[0, 0] == x and log.wheels.places.tolist() == [place]
    placed = load_log(tmp_path / "c.log", poses="odom").poses[0]
    assert placed == pytest.approx([2.46, 0.0, 0.0])


def test_scans_and_odometry_are_put_in_the_order_of_their_stamps(tmp_path):
    odom = [f"ODOM {k} 0 0 0 0 0 {k / 8} host 0" for k in range(6)]
    raw = [f"RAWLASER1 0 -1 2 1 20 0 0 3 1 2 3 0 {k / 8 + 0.0625} host 0" for k in range(5)]
    # All of one kind together, or the last first.
    for lines in ([*odom, *raw], [*raw, *odom], sorted([*odom, *raw], key=str.split)[::-1]):
        log = load_log(write(tmp_path / "a.log", *lines))
        assert log.poses[:, 0].tolist() == [0.5, 1.5, 2.5, 3.5, 4.5] and "order" in log.notes[0]
        assert log.wheels.places.tolist() == [0, 1, 2, 3, 4]
    # Poses of the truth are kept.
    true = [f"TRUEPOS {k} 1 0 0 0 0 {k / 8} host 0" for k in range(5)]
    rows = [line for pair in zip(true, raw, strict=True) for line in pair]
    log = load_log(write(tmp_path / "a.log", *odom, *rows))
    assert log.poses[:, :2].tolist() == [[k, 1.0] for k in range(5)] and not log.notes


def test_lines_of_robots_of_carnegie_mellon_are_in_centimetres(tmp_path):
    ranges = " ".join(map(str, range(150, 330)))
    lines = ["O 100 0 0.5 1.5", f"L 200 100 0 225 100 0 {ranges} 2", "O 200 100 0 2.5"]
    log = load_log(write(tmp_path / "robotdata1.log", *lines))
    assert log.poses.tolist() == [[2.25, 1.0, 0.0]] and log.mount == (0.25, 0.0, 0.0)
    assert log.scans[0].ranges == pytest.approx(0.01 * np.arange(150, 330))
    assert log.times.tolist() == [2.0]
    assert log.odometry.poses.tolist() == [[1.0, 0.0, 0.5], [2.0, 1.0, 0.0]]
    # They do not say how wide their fan is.
    assert np.degrees(log.fans[-1]) == pytest.approx([-180.0, 178.0])
    metres = " ".join(f"{number / 100:.2f}" for number in range(150, 330))
    taken = load_log(write(tmp_path / "metres.log", lines[0], lines[1].replace(ranges, metres)))
    with pytest.raises(InputError, match="19 of 20 ranges are under"):
        map_log(taken)
