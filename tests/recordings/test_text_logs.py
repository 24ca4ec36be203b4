"""Scans in text and array files: the same drive, written as people write it, is the same log."""

import gzip
import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.io import savemat
from text_shapes import (
    LDS,
    PLACED,
    ROBOTS,
    RPLIDAR,
    S300,
    SICK,
    URG,
    Drive,
    counted_ranges,
    encoder_ticks,
    names,
    pairs,
    parts,
    with_words,
)
from text_shapes import lines as text

from lrf3d import InputError, load_log, map_log
from lrf3d.recordings.formats.text.dialects import DIALECTS, dialect_of
from lrf3d.recordings.formats.text.guesses import GUESSES

# A drive of a robot with a SICK.
BEAMS = SICK.beams
ANGLES = SICK.angles
TIMES = SICK.times
POSES = SICK.poses
RANGES = SICK.ranges


def check(log, drive, *, apart):
    """Whether a log has the scans of a drive, to a hundredth of a degree and so many metres."""
    found = np.array([scan.ranges for scan in log.scans])
    known = np.isfinite(drive.ranges)
    assert log.bad_count == 0 and found.shape == drive.ranges.shape
    assert found[known] == pytest.approx(drive.ranges[known], abs=apart)
    assert not np.isfinite(found[~known]).any()
    assert np.allclose([scan.angles for scan in log.scans], drive.angles, atol=2e-4)


# Each shape for two of the robots, by turns.
SHAPES = [
    pytest.param(shape, list(ROBOTS)[(k + j) % 4], marks=[pytest.mark.slow] * j)
    for k, shape in enumerate(PLACED)
    for j in (0, 1)
]


@pytest.mark.parametrize("shape, robot", SHAPES)
def test_columns_are_found_in_each_shape_for_each_robot(shape, robot, written):
    drive = ROBOTS[robot]
    log = load_log(written("drive.csv", PLACED[shape](drive)))
    check(log, drive, apart=1e-3)
    assert log.placed and log.notes
    assert np.diff(log.times) == pytest.approx(np.diff(drive.times), abs=1e-3)
    assert log.poses[:, :2] == pytest.approx(drive.poses[:, :2], abs=1e-3)
    assert np.cos(log.poses[:, 2] - drive.poses[:, 2]).min() > 1 - 1e-5


@pytest.mark.parametrize("nothing", ["NaN", "null", "N/A"])
def test_words_for_missing_readings_mean_no_return(nothing, written):
    drive = replace(S300, farthest=3.5)
    path = written("drive.txt", with_words(nothing, "inf")(drive))
    log = load_log(path)
    assert "inf" in path.read_text() and nothing in path.read_text()
    check(log, drive, apart=1e-3)


def test_blank_cells_at_the_end_of_a_row_are_missing_readings(tmp_path):
    drive = replace(S300, farthest=3.5)
    head = names(drive, "range_{}", ",", "time", "x", "y", "theta")
    (tmp_path / "drive.csv").write_text(text(parts(drive), ",", head).replace("nan", ""))
    assert ",,\n" in (tmp_path / "drive.csv").read_text()
    check(load_log(tmp_path / "drive.csv"), drive, apart=1e-3)


@pytest.mark.parametrize(
    "drive, write, form",
    [
        (URG, encoder_ticks, "stamp:us@1, left@3, right@4, ranges:mm*682@25, first=-120deg,"
         " last=120deg, tick=0.2mm, track=0.3m, offset=0.1m"),
        (Drive(660, -120, 111.68, 6.0), counted_ranges,
         "stamp:ms@2, ranges:mm@4, first=-120deg, last=111.68deg"),
        (RPLIDAR, pairs, "angles:deg@1, ranges:m@2"),
        (URG, pairs, None),
    ],
)  # fmt: skip
def test_a_format_says_what_lines_do_not(drive, write, form, written):
    log = load_log(written("drive.dat", write(drive)), format=form)
    check(log, drive, apart=1e-3)
    assert len(log) == drive.count and log.placed == (write is encoder_ticks)
    if write is not pairs:
        assert np.diff(log.times) == pytest.approx(1 / drive.rate, abs=1e-3)


def test_dialects_and_guesses_have_names_and_sentences_of_their_own():
    for each in (DIALECTS, GUESSES):
        assert len({one.name for one in each}) == len({one.what for one in each}) == len(each)
        assert all(one.what.endswith(".") for one in each)


@pytest.mark.parametrize(
    "shape, name",
    [("bare numbers", "spaces"), ("a header", "commas"), ("tabs", "tabs"),
     ("semicolons, decimal commas", "semicolons"), ("spaces, decimal commas", "spaces"),
     ("a numpy print", "tuples"), ("vertical bars", "bars")],
)  # fmt: skip
def test_each_shape_is_of_one_dialect(shape, name, tmp_path):
    lines = PLACED[shape](LDS).splitlines()
    assert dialect_of(lines).name == name


MINESROVER = (
    "stamp:us@1, left@3, right@4, ranges:mm*682@25, first=-120deg, last=120deg,"
    " tick=0.24190263mm, track=0.33m, offset=0.145m"
)
LEGO = "stamp:ms@2, ranges:mm@4, first=-120.0156deg, step=0.3515625deg"
MOTORS = "stamp:ms@2, left@3, right@7, tick=0.349mm, track=0.15m, offset=0.03m"


@pytest.mark.slow
def test_a_format_names_columns_units_bearings_and_wheels(written):
    clockwise = 100.0 * RANGES[:, ::-1]
    path = written(
        "drive.dat.gz",
        gzip.compress(text([clockwise, np.degrees(POSES[:, 2]), POSES[:, :2]]).encode()),
    )
    spec = f"ranges:cm*{BEAMS}, theta:deg, x, y, first=90deg, step=-1deg"
    for form in (
        spec,
        spec.replace("first=90deg, step=-1deg", "first=-90deg, last=90deg, clockwise"),
    ):
        log = load_log(path, format=form)
        assert len(map_log(log).map) == 4
        assert any("no stamps" in note for note in log.notes)
    ticks = np.cumsum(np.full((40, 2), [100.0, 110.0]), axis=0) % 65536
    lines = np.column_stack([1e5 * np.arange(40), np.zeros(40), ticks, np.zeros((40, 20)),
                             np.full((40, 682), 2000.0) + np.arange(682)])  # fmt: skip
    path.write_bytes(gzip.compress(text([lines], form="{:.0f}").encode()))
    with pytest.raises(InputError, match=r"706 columns.*--format, such as 'stamp@1, ranges@25'"):
        load_log(path)
    log = load_log(path, format=MINESROVER)
    assert log.placed and log.odometry.laser_offset == pytest.approx(0.145)
    assert log.odometry.poses[-1, 2] == pytest.approx(39 * 10 * 0.00024190263 / 0.33, rel=1e-6)


@pytest.mark.parametrize(
    "lines, form, reason",
    [
        ("1 2 3\n4 5 6\n", None, r"text of 3 columns; name them by --format"),
        ("hello\nworld\n", None, "no lines of numbers"),
        ("t,x,y,yaw\n1,2,3,4\n2,2,3,4\n", None, "none of ranges; is it odometry"),
        ("\n".join(["20 " * 375] * 2), None, "text of 375 columns; name them by --format$"),
        ("1 5\n2 5\n", "stamp,ranges", "one beam"),
        ("1 5 5 5\n2 5 5 5\n", "stamp,ranges", "all are 5"),
        ("1 5 6 7\n2 5 6 8\n", "stamp,ranges:m", "3 beams at unknown.*such as 'first=-\\d+deg,"),
        ("1 5 6 7\n2 5 6 8\n", "stamp,ranges:m,first=0deg,step=200deg", "over 400°"),
        ("1 5 6 7\n2 5 6 8\n", "stamp,rangs:m", "did you mean 'ranges'"),
        ("1 5 6 7\n2 5 6 8\n", "stamp,ranges:mile", "mile"),
        ("1 50 60 70\n2 50 60 80\n", "stamp,ranges,first=0deg,step=1deg", "name their unit"),
        ("1 5 6 7\n2 5 6 8\n", "left,right,ranges:m,first=0deg,step=1deg", "tick="),
        ("1 5 6 7\n2 5 6 8\n", "ranges:m@9", "2 bad lines, first line 1: 4 columns"),
        (encoder_ticks(replace(URG, beams=682)), None, "--format, such as '"),
        (counted_ranges(replace(URG, beams=660)), None, "--format, such as '"),
    ],
)  # fmt: skip
def test_what_cannot_be_read_gets_one_line(lines, form, reason, written):
    path = written("drive.txt", lines)
    with pytest.raises(InputError, match=reason):
        load_log(path, format=form)


def test_bad_lines_are_counted_and_short_ones_are_filled(written):
    lines = text([TIMES, POSES, RANGES]).splitlines()
    lines[3] = lines[3].replace(" ", " x", 1)
    lines[5] = lines[5].rpartition(" ")[0]
    path = written("drive.txt", "\n".join(lines))
    log = load_log(path)
    assert log.bad_count == 2 and [line.number for line in log.bad_lines] == [4, 6]
    counts = [BEAMS, 170] * 20
    counted = [
        " ".join(["S", str(k), str(n), *map(str, row[:n])])
        for k, (n, row) in enumerate(zip(counts, RANGES.tolist(), strict=True))
    ]
    path.write_text("\n".join(counted))
    log = load_log(path)
    assert not log.placed and "20 scans with fewer than 181" in " ".join(log.notes)
    assert np.isneginf(log.scans[1].ranges[170:]).all()
    records = [
        json.dumps({"ranges": row[:n]}) for n, row in zip(counts, RANGES.tolist(), strict=True)
    ]
    path.write_text("\n".join(records))
    assert "20 scans with fewer than 181" in " ".join(load_log(path).notes)


def test_the_motors_of_a_robot_are_in_a_file_beside_its_scans(tmp_path):
    ranges = " ".join(map(str, range(1000, 1660)))
    scans = [f"S {100 * k} 660 {ranges}" for k in range(10)]
    motors = [f"M {100 * k} {20 * k} 0 0 0 {30 * k} 0 0" for k in range(10)]
    (tmp_path / "a_scan.txt").write_text("\n".join(scans))
    form = f"{LEGO}; {MOTORS}"
    assert "no odometry" in " ".join(load_log(tmp_path / "a_scan.txt", format=form).notes)
    (tmp_path / "a_motors.txt").write_text("\n".join(motors))
    log = load_log(tmp_path / "a_scan.txt", format=form)
    assert log.odometry.poses[-1, 2] == pytest.approx(9 * 10 * 0.349e-3 / 0.15)
    assert log.placed and "a_motors.txt" in " ".join(log.notes)


def test_a_reading_a_line_makes_scans(written):
    rng = np.random.default_rng(0)
    for stamped in (True, False):
        lines = ["t,angle_deg,dist_mm" if stamped else "angle_deg;dist_mm"]
        for time, row in zip(TIMES, RANGES, strict=True):
            for bearing in np.flatnonzero(rng.random(360) < 0.9):
                reading = f"{bearing + 0.1:.2f}", f"{1e3 * row[bearing % BEAMS]:.0f}"
                lines.append(",".join([f"{time:.3f}", *reading]) if stamped else ";".join(reading))
        log = load_log(written("lidar.csv", "\n".join(lines)))
        assert len(log) == 40 and not log.placed and "gathered" in " ".join(log.notes)
        for scan, row in zip(log.scans, RANGES, strict=True):
            found = scan.hits & (np.degrees(scan.angles) < 90)
            expected = row[np.rint(np.degrees(scan.angles[found]) - 0.1).astype(int)]
            # A fan has as many beams as most scans, a tenth fewer than there are bearings.
            assert np.abs(scan.ranges[found] - expected).max() < 0.6 and found.sum() > 60


def test_arrays_are_read_by_their_names(tmp_path):
    np.savez(tmp_path / "drive.npz", ranges=RANGES, angles=ANGLES, stamps_s=TIMES, poses=POSES)
    savemat(tmp_path / "drive.mat", {"data": {"Ranges": RANGES.T, "Angles": np.degrees(ANGLES),
                                              "time": TIMES, "pose": POSES.T}})  # fmt: skip
    np.savez(tmp_path / "more.npz", laser_ranges=RANGES, range=9.0, stamps_s=TIMES, poses=POSES)
    savemat(tmp_path / "velocity.mat", {
        "velocity_ns": {"ranges": RANGES, "pose": POSES},
        "stamp": {"sec": TIMES // 1, "nanosec": 1e9 * (TIMES % 1)},
    })  # fmt: skip
    for name in ("drive.npz", "drive.mat", "more.npz", "velocity.mat"):
        log = load_log(tmp_path / name)
        assert np.diff(log.times) == pytest.approx(np.diff(TIMES), abs=1e-5)
        assert log.times[0] == pytest.approx(TIMES[0]) and np.allclose(log.poses[:, 0], POSES[:, 0])
        assert name[:5] != "drive" or len(map_log(log).map) == 4
    np.savez(tmp_path / "other.npz", picture=RANGES)
    with pytest.raises(InputError, match=r"no ranges .*picture \(40, 181\)"):
        load_log(tmp_path / "other.npz")


PRINTED = """header:
  stamp: {{sec: {sec}, nanosec: {nanosec}}}
  frame_id: laser
angle_min: {first}
angle_increment: {step}
ranges: {ranges}
---
"""

MESSAGES = {
    "short.txt": lambda r, p, t: f"FLASER {BEAMS} {r} {p} {p}",
    "old.txt": lambda r, p, t: f"FLASER {BEAMS} {r} {p} {p} {t}",
    "other.txt": lambda r, p, t: f"Odometry {p}\nLaser {BEAMS} {r}",
    "gmapping.gfs": lambda r, p, t: f"ODO_UPDATE 3\nODOM {p} {t}\n"
    f"LASER_READING {BEAMS} {r} {p} {t}",
    "raw.log": lambda r, p, t: f"ODOM {p} 0 0 0 {t} h {t}\n"
    f"RAWLASER1 0 {ANGLES[0]} 3.14 {ANGLES[1] - ANGLES[0]} 9 0 0 {BEAMS} {r} 0 {t} h {t}\n"
    f"RLASER {BEAMS} {r} {p} {p} {t} h {t}",
    "player.log": lambda r, p, t: f"{t} 16 6665 position2d 00 001 001 {t} {p} 0 0 0 1\n"
    f"{t} 16 6665 laser 00 001 001 {t} 0 {ANGLES[0]} 1.57 {ANGLES[1] - ANGLES[0]} 9 {BEAMS} "
    + " ".join(f"{each} 0" for each in r.split()),
    "third_player.log": lambda r, p, t: f"{t} 16 6665 position2d 00 001 001 {p} 0 0 0 1\n"
    f"{t} 16 6665 laser 00 001 001 0007 {ANGLES[0]} 1.57 {ANGLES[1] - ANGLES[0]} 9 {BEAMS} "
    + " ".join(f"{each} 0" for each in r.split()),
    "first_player.log": lambda r, p, t: f"ODOM {p} {t}\n"
    f"{t} fly 6665 laser 00 {t} {ANGLES[0]} 1.57 {ANGLES[1] - ANGLES[0]} {BEAMS} "
    + " ".join(f"{each} 0" for each in r.split()),
    "lines.jsonl": lambda r, p, t: json.dumps({
        "time": t, "pose": dict(zip(("x", "y", "theta"), map(float, p.split()), strict=True)),
        "angle_min": ANGLES[0], "angle_increment": ANGLES[1] - ANGLES[0],
        "ranges": [None, *map(float, r.split())][1:],
    }),
    "python.txt": lambda r, p, t: str({
        "header": {"stamp": {"secs": int(t), "nsecs": int(1e9 * (t % 1))}, "frame_id": "laser"},
        "pose": dict(zip("x y theta".split(), map(float, p.split()), strict=True)),
        "angle_min": ANGLES[0].item(), "angle_max": ANGLES[-1].item(),
        "ranges": [float("inf"), *map(float, r.split())][1:],
    }),
    "quoted.csv": lambda r, p, t: f"2024/05/01 11:06:36.445,\"{{'stamp': {t}, 'frame_id': 'b'}}\","
    f'"[{", ".join(r.split())}]","[]",{",".join(p.split())}',
    "lists.csv": lambda r, p, t: f"{t},[{', '.join(r.split())}],,{','.join(p.split())}",
    "bag.csv": lambda r, p, t: ",".join([
        "2023/01/02/03:04:05.6", f"{int(t)},{int(1e9 * (t % 1))},9", *p.split()[:2], "0,0",
        str(np.sin(0.5 * float(p.split()[2]))), str(np.cos(0.5 * float(p.split()[2]))),
        f'"({", ".join(r.split())})"',
    ]),
}  # fmt: skip
"""A scan, its pose and its time, as programs write them."""

HEADS = {
    "quoted.csv": ["time,header,ranges,intensities,x,y,theta"],
    "lists.csv": ["time,ranges,other,x,y,theta"],
    "bag.csv": [
        "time,.header.stamp.secs,.header.stamp.nsecs,.twist.x,.pose.position.x,.pose.position.y,"
        + ",".join(f".pose.orientation.{axis}" for axis in "xyzw") + ",.ranges"
    ],
}  # fmt: skip


@pytest.mark.parametrize("name", MESSAGES)
def test_messages_and_records_of_other_programs_are_read(name, written):
    lines = [
        MESSAGES[name](" ".join(map(str, row)), " ".join(map(str, pose)), time)
        for time, pose, row in zip(*(each.tolist() for each in (TIMES, POSES, RANGES)), strict=True)
    ]
    log = load_log(written(name, "\n".join(HEADS.get(name, []) + lines) + "\n"))
    assert log.bad_count == 0 and log.placed
    for field, wanted in (("ranges", RANGES), ("angles", [ANGLES] * 40)):
        assert np.allclose([getattr(scan, field) for scan in log.scans], wanted, atol=1e-3)
    assert np.allclose(log.poses, POSES - [0, 0, 2 * np.pi] * (POSES > np.pi), atol=1e-3)
    assert np.diff(log.times) == pytest.approx(0.1, abs=1e-3)
    assert any("no stamps" in note for note in log.notes) == (name in ("short.txt", "other.txt"))
    assert any("unknown mounts (40 of laser2)" in note for note in log.notes) == (name == "raw.log")


def test_printed_messages_get_the_poses_in_a_file_beside_them(written, tmp_path):
    stamp = [{"sec": int(t), "nanosec": int(1e9 * (t % 1))} for t in TIMES]
    scans = [
        PRINTED.format(**s, first=ANGLES[0], step=ANGLES[1] - ANGLES[0], ranges=row.tolist())
        for s, row in zip(stamp, RANGES, strict=True)
    ]
    path = written("a_scan.txt", "".join(scans))
    assert not load_log(path).placed
    half = 0.5 * POSES[:, 2]
    tum = np.column_stack(
        [TIMES, POSES[:, :2], 0 * TIMES, 0 * TIMES, 0 * TIMES, np.sin(half), np.cos(half)]
    )
    np.savetxt(tmp_path / "a_poses.txt", tum[:-20], fmt="%.9f")
    log = load_log(path)
    # Scans a while after the last pose are left out, not placed there.
    assert 20 <= len(log) < 22 and log.poses[:20, :2] == pytest.approx(POSES[:20, :2], abs=1e-3)
    assert len(map_log(log).map) == 4 and "left out" in " ".join(log.notes)
    path.write_text("".join(scans).replace(", 4.0]", ", '...']").replace("]", ", '...']"))
    with pytest.raises(InputError, match="--full-length"):
        load_log(path)


SWEEPS = {
    "labels": lambda a, d: f"theta: {a:06.2f} Dist: {d:08.2f} Q: {47 * (d > 0)}",
    "booleans": lambda a, d: f"{a < 1}\t{15 * (d > 0)}\t{a:.3f}\t{d:.1f}",
    "plain": lambda a, d: f"{a:.2f} {d:.0f} {15 * (d > 0)}",
    "named": lambda a, d: f"{15 * (d > 0)},{a:.3f},{d:.1f},0.5,0.6,1.0",
    "tuples": lambda a, d: f"({15 * (d > 0)}, {a:.3f}, {d:.1f})",
}


@pytest.mark.parametrize("kind", SWEEPS)
def test_readings_of_rplidars_are_gathered_clockwise(kind, written):
    lines = ["Quality, Angle, Distance, Acceleration X, Acceleration Y, Yaw"] * (kind == "named")
    for row in RANGES:
        sweep = [SWEEPS[kind](a, 1e3 * row[180 - a] if a <= 180 else 0.0) for a in range(360)]
        lines += [f"[{', '.join(sweep)}]"] if kind == "tuples" else sweep
    log = load_log(written("lidar.txt", "\n".join(lines)))
    assert len(log) == 40 and not log.placed and "clockwise, as RPLIDARs" in " ".join(log.notes)
    for scan, row in zip(log.scans, RANGES, strict=True):
        # The first bearing is 0, and those of the row begin at −180° when turned this way.
        places = np.rint(np.degrees(-scan.angles)).astype(int)
        known = (places <= 180) & scan.hits
        assert scan.ranges[known] == pytest.approx(row[180 - places[known]], abs=2e-3)
        assert known.sum() == 181


@pytest.mark.parametrize(
    "begin, line",
    [
        ("AngleInDegrees,DistInMM,Intensity,ErrorCodeHEX", "{a},{mm:.0f},200,803a"),
        ("angle(rad) range(m) intensity", "{rad:.6f} {m:.4f} 100"),
    ],
)
def test_a_header_says_what_its_columns_are_and_that_intensities_are_no_qualities(
    begin, line, written
):
    lines = [
        "\n".join([begin, *(line.format(a=a, rad=np.radians(a), m=row[a], mm=1e3 * row[a])
                            for a in range(BEAMS))])
        for row in RANGES
    ]  # fmt: skip
    log = load_log(written("lds.csv", "\n".join(lines)))
    assert len(log) == 40 and log.bad_count == 0
    assert np.allclose([scan.ranges for scan in log.scans], RANGES, atol=1e-3)
    assert np.allclose(np.degrees(log.scans[0].angles), range(BEAMS), atol=1e-3)


@pytest.mark.parametrize(
    "stamp",
    [
        lambda number: number // BEAMS,
        # Seconds of a coarse clock, and packets of 12 readings.
        lambda number: number // (7 * BEAMS),
        lambda number: number // 12,
    ],
)
def test_a_turn_is_a_scan_whatever_clock_stamps_it_and_its_first_returns_count(stamp, written):
    lines = [
        f"{stamp(BEAMS * k + a)},{a},{each:.4f}"
        for k, row in enumerate(RANGES) for a in range(BEAMS)
        for each in (0.0, np.inf, row[a], row[a] + 0.9)
    ]  # fmt: skip
    log = load_log(written("dual.csv", "\n".join(["time,angle,distance", *lines])))
    assert len(log) == 40
    assert np.allclose([s.ranges[s.hits] for s in log.scans], RANGES, atol=1e-3)


@pytest.mark.parametrize(
    "bearings",
    [
        # A wide fan that does not count through 360°, interlaced sweeps, and three heads.
        [*range(-45, 226)],
        [*range(0, 180, 2), *range(1, 180, 2)],
        [a + b for a in range(90) for b in (0, 180, 90)],
    ],
)
def test_scans_with_stamps_of_their_own_are_neither_torn_nor_mirrored(bearings, written):
    lines = [f"{k},{a},{row[a % BEAMS]:.4f},20" for k, row in enumerate(RANGES) for a in bearings]
    log = load_log(written("wide.csv", "\n".join(["time,angle,distance,quality", *lines])))
    assert len(log) == 40
    for scan, row in zip(log.scans, RANGES, strict=True):
        found = np.rint(np.degrees(scan.angles[scan.hits])).astype(int)
        assert found.tolist() == sorted(bearings)
        assert np.allclose(scan.ranges[scan.hits], row[found % BEAMS], atol=1e-3)


@pytest.mark.parametrize("columns", ["time,left,right", "time,left,right,foo,bar"])
def test_encoder_ticks_beside_scans_are_no_poses(columns, tmp_path):
    head = ",".join(["time", *map(str, range(BEAMS))])
    (tmp_path / "a_scan.csv").write_text(text([TIMES, RANGES], ",", head))
    ticks = TIMES[:, None] * [1, 100, 110, 0, 1]
    (tmp_path / "a_odom.csv").write_text(text([ticks[:, : columns.count(",") + 1]], ",", columns))
    log = load_log(tmp_path / "a_scan.csv")
    assert not log.placed and "holds no poses that are understood" in " ".join(log.notes)


def test_bare_ranges_get_their_units_and_bearings_from_what_is_known(tmp_path):
    ranges = RANGES[:, :180]
    head = ",".join(["time", *map(str, range(180))])
    (tmp_path / "a.csv").write_text(text([TIMES, ranges], ",", head))
    np.save(tmp_path / "a.npy", 1e3 * ranges)
    by_header = load_log(tmp_path / "a.csv")
    by_format = load_log(tmp_path / "a.npy", format="ranges:mm, first=90deg, step=-1deg")
    assert by_header.times == pytest.approx(TIMES, abs=1e-3)
    assert np.degrees(by_format.scans[0].angles[[0, -1]]) == pytest.approx([90, -89])
    for one, other in zip(by_header.scans, by_format.scans, strict=True):
        assert one.ranges == pytest.approx(other.ranges, abs=1e-3)
    np.save(tmp_path / "a.npy", np.array([{}]), allow_pickle=True)
    with pytest.raises(InputError, match="no file of arrays of numbers"):
        load_log(tmp_path / "a.npy")


def test_telegrams_of_sick_are_read(written):
    """Their bearings are in ten thousandths of a degree, and ahead is 90°."""
    lines = [
        f"\x02sSN LMDscandata 0 1 89A27F 0 0 1 1 {round(1e6 * t):X} 0 0 0 3F 0 0 1388 168 0 1 DIST1"
        f" 40000000 00000000 FFFFF63C 2710 {BEAMS:X} "
        + " ".join(f"{round(500 * each):X}" for each in row) + " 0 0\x03"
        for t, row in zip(TIMES - TIMES[0], RANGES, strict=True)
    ]  # fmt: skip
    log = load_log(written("tim.txt", "\n".join([*lines, "sSN LMDscandata DIST1 0 1 2 3 4"])))
    assert len(log) == 40 and not log.placed and log.bad_count == 1
    assert np.allclose(log.times, TIMES - TIMES[0])
    assert np.allclose(log.scans[0].angles, ANGLES - np.radians(0.25))
    assert np.allclose([scan.ranges for scan in log.scans], RANGES, atol=2e-3)


def test_a_file_that_is_no_log_gets_a_line_that_says_what_it_looks_like(written):
    for data, reason in ((b"\x89PNG\r\n", "a picture"), (b"ply\nformat", "a point cloud"),
                         (b"\xff\xfe1\0", "UTF-16"), (b"\0\1\2", "no text")):  # fmt: skip
        path = written("what.xyz", data)
        with pytest.raises(InputError, match=f"what.xyz: not a log: it looks like .*{reason}"):
            load_log(path)
