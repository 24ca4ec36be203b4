"""One drive in the many forms that programs write their numbers in."""

import json

import numpy as np
import pytest

from lrf3d import InputError, load_log

COUNT, BEAMS = 12, 180
RANGES = np.random.default_rng(0).uniform(1.0, 6.0, (COUNT, BEAMS)).round(3)
POSES = np.column_stack([0.05 * np.arange(COUNT), np.full(COUNT, -1.5), np.full(COUNT, 0.25)])
TIMES = 0.1 * np.arange(COUNT) + 50.0
NAMES = ["time", "x", "y", "yaw", *(f"range_{k}" for k in range(BEAMS))]
ROWS = [[f"{t:.2f}", *map(str, p), *map(str, r)]
        for t, p, r in zip(TIMES, POSES.tolist(), RANGES.tolist(), strict=True)]  # fmt: skip
PLAIN = [NAMES, *ROWS]


def joined(rows, separator=",", cell=str):
    return "\n".join(separator.join(map(cell, row)) for row in rows)


def echo(rows, light=(), cut=()):
    """Messages as ``ros2 topic echo --csv`` prints them."""
    fan = f"laser,{-np.pi / 2},{np.radians(89)},{np.pi / 180},0.0,0.1,0.05,10.0"
    for t, row in zip(TIMES, rows, strict=True):
        seconds, nanoseconds = divmod(round(t * 1e9), 1_000_000_000)
        yield f"{seconds},{nanoseconds},{fan},{','.join([*row[4:], *light, *cut])}"


def units(scale, names, degrees=False):
    factors = [1.0, scale, scale, np.degrees(1) if degrees else 1.0, *[scale] * BEAMS]
    rows = [[f"{f * float(w):.9g}" for f, w in zip(factors, r, strict=True)] for r in ROWS]
    return joined([names, *rows])


def dated(zone):
    """Rows with a date and a time of day, around midnight."""
    days = ["2024-02-28T23:59:", "2024-02-29T00:00:"]
    return [[f"{days[int(t >= 50.5)]}{(t + 9.5) % 60.0:06.3f}{zone}", *r[1:]]
            for t, r in zip(TIMES, ROWS, strict=True)]  # fmt: skip


FORMS = {
    "empty cells": joined(
        [NAMES, *([*row[:90], "", "null", "N/A", "-", *row[94:]] for row in ROWS)]),
    "an empty first cell": joined([NAMES, ["50.0", "", *ROWS[0][2:]], *ROWS]),
    "a last column that is mostly blank, and a blank line of cells": joined(
        [[*NAMES, "note"], [*ROWS[0], "start"], [" "] * 5, *([*row, ""] for row in ROWS[1:])]),
    "comments before and between": "# made by, a, logger\n" + joined(
        [NAMES, *ROWS[:5], ["// a note, here"], *ROWS[5:]]),
    "quoted decimal commas": joined(PLAIN, cell=lambda word: f'"{word.replace(".", ",")}"'),
    "units after a slash": units(100.0, ["t/s", "x/cm", "y/cm", "yaw/deg",
                                         *(f"r{k}/cm" for k in range(BEAMS))], degrees=True),
    "units in brackets": units(1e3, ["Time (s)", "X (mm)", "Y (mm)", "Heading (rad)",
                                     *(f"Distance {k} (mm)" for k in range(BEAMS))]),
    "feet": units(1 / 0.3048, ["time", "x_ft", "y (feet)", "yaw",
                               *(f"range_{k}_ft" for k in range(BEAMS))]),
    "inches": units(1 / 0.0254, ["time", "x (inch)", "y_inches", "yaw",
                                 *(f"range_inch_{k}" for k in range(BEAMS))]),
    "a corner that is no number beside bearings": joined(
        [["NaN", *range(-90, 90)], *([row[0], *row[4:]] for row in ROWS)]),
    "JSON with a name for each beam": "\n".join(
        json.dumps({name: None if word == "6.0" else float(word)
                    for name, word in zip(NAMES, row, strict=True)}) for row in ROWS),
    "JSON with names in the order of letters": "\n".join(
        json.dumps(dict(zip(NAMES, map(float, row), strict=True)), sort_keys=True)
        for row in ROWS),
    "dates": joined([["datetime", *NAMES[1:]], *dated("Z")]),
    "dates with a zone": joined([["datetime", *NAMES[1:]], *dated("+02:00")]),
    "days since 1900": joined([NAMES, *([repr(45000.5 + float(row[0]) / 86400), *row[1:]]
                                        for row in ROWS)]),
    "more than a day and an hour": joined([NAMES, *([f"25:75:{row[0]}", *row[1:]]
                                                    for row in ROWS)]),
    "tabs before all lines": joined([NAMES, *(["", *row] for row in ROWS)], "\t"),
    "tabs below a column without a name": joined(
        [["", *NAMES], *([str(k), *row] for k, row in enumerate(ROWS))], "\t"),
    "German dates": joined(
        [NAMES, *([f"01.03.2024 12:00:{row[0]}", *row[1:]] for row in ROWS)], ";",
        lambda word: word.replace(".", ",") if word[2:3] != "." or " " not in word
        else word[:11] + word[11:].replace(".", ",")),
    "numbers of NumPy": "\n".join(str([*map(np.float64, row)]) for row in ROWS),
    "a table of columns": json.dumps({
        name: dict(zip(map(str, range(COUNT)), column, strict=True))
        for name, column in zip(["time", "x", "y", "yaw", "ranges"],
                                [TIMES.tolist(), *POSES.T.tolist(), RANGES.tolist()], strict=True)
    }),
    "a list in a cell": "time;x;y;theta;ranges\n" + "\n".join(
        f"{';'.join(row[:4])};[{', '.join(row[4:])}]" for row in ROWS),
    "lists one after the other": "\n".join(
        f"[{', '.join(row[:4])}] [{', '.join(row[4:])}]" for row in ROWS),
    "names before numbers and a list": "\n".join(
        f"time={row[0]} x={row[1]} y={row[2]} yaw={row[3]} ranges=[{','.join(row[4:])}]"
        for row in ROWS),
    "names before an empty list": "\n".join(
        f"time={row[0]} x={row[1]} y={row[2]} yaw={row[3]} ranges=[{','.join(row[4:])}]"
        " intensities=[]" for row in ROWS),
    "a number of ranges among names": f"% time x y theta {BEAMS} ranges\n" + joined(ROWS, " "),
    "arrays as Python prints them": joined(
        [["time", "x", "y", "theta", "ranges"],
         *([*r[:4], f"\"array('f', [{', '.join(r[4:])}])\""] for r in ROWS)]),
    "records after a byte order mark": "\ufeff" + "\n".join(
        json.dumps({"t": float(r[0]), "pose": [*map(float, r[1:4])],
                    "ranges": [*map(float, r[4:])]}) for r in ROWS),
    "dicts that Python prints": "\n".join(
        str({"time": float(row[0]), "pose": (*map(float, row[1:4]),),
             "ranges": [*map(float, row[4:])]}) for row in ROWS),
    "a list over several lines": "\n".join(
        f"[{' '.join(row[:50])}\n {' '.join(row[50:120])}\n {' '.join(row[120:])}]"
        for row in ROWS),
    "a sentence that ends with the names": units(
        1.0, ["made on 3 May, 17:53:11, format: time[s], x[m] y[m] yaw[degrees] r1 ... r180"],
        degrees=True,
    ).replace(",", " "),
    "a sentence that names too many columns":
        "# format: time x y yaw r0 ... r999999999\n" + joined(ROWS, " "),
    "spaces before a list": "\n".join(
        f"{row[0]} {-np.pi / 2} {np.radians(89)} {np.pi / 180} {BEAMS} {', '.join(row[4:])}"
        for row in ROWS),
    "records with pairs of a bearing and a range": json.dumps([
        dict(zip(["time", "x", "y", "theta", "scan"], [*map(float, row[:4]), [
            [k - 90.0, float(r)] for k, r in enumerate(row[4:])]], strict=True))
        for row in ROWS]),
    "bearings that begin anew at 0° beside ranges": joined(
        [*row[:4], *(word for k, r in enumerate(row[4:]) for word in (str((k - 90) % 360), r))]
        for row in ROWS),
    "records with lists of bearings": "\n".join(
        json.dumps({"theta": np.radians(np.arange(-90.0, 90.0)).tolist(), "time": float(row[0]),
                    "readings": [*map(float, row[4:])], "odometry": [*map(float, row[1:4])]})
        for row in ROWS),
    "records with a date, and points of which one has a list": json.dumps([
        {"datetime": "2024-02-28T23:59:05", "timestamp": float(row[0]),
         **dict(zip(["x", "y", "theta"], map(float, row[1:4]), strict=True)),
         "scan": [{"angle": np.radians(k - 90), "d": float(r), **({"tags": [1]} if k == 9 else {})}
                  for k, r in enumerate(row[4:])]} for row in ROWS]),
    "records with a distance elsewhere": json.dumps([
        {"time": {"value": float(row[0])}, "laser": {"data": [*map(float, row[4:])]},
         "odometry": [*map(float, row[1:4])], "goal": {"distance": 3.0, "t": 9.0}}
        for row in ROWS]),
    "records by their numbers": json.dumps({
        f"scan{k}": dict(zip(["time", "x", "y", "theta", "ranges"],
                             [*map(float, row[:4]), [float(r) for r in row[4:]]], strict=True))
        for k, row in enumerate(ROWS)}),
}  # fmt: skip


@pytest.mark.parametrize("form", FORMS)
def test_a_drive_is_read_in_each_form(form, written):
    path = written(
        "drive.log" if form.startswith("a sentence") else "drive.csv", FORMS[form] + "\n"
    )
    log = load_log(path)
    read, known = np.array([scan.ranges for scan in log.scans]), np.ones(BEAMS, dtype=bool)
    if form == "empty cells":
        known[86:90] = False
        assert np.isposinf(read[:, ~known]).all()
    assert read[:, known] == pytest.approx(RANGES[:, known])
    if form in ("spaces before a list", "a corner that is no number beside bearings"):
        assert log.scans[0].angles == pytest.approx(np.radians(np.arange(-90, 90)))
    else:
        assert log.poses == pytest.approx(POSES)
    assert log.times - log.times[0] == pytest.approx(TIMES - TIMES[0], abs=1e-6)
    assert log.bad_count == (form == "an empty first cell")


@pytest.mark.parametrize("light", [(), ["47.0"] * BEAMS])
def test_what_ros2_topic_echo_prints_as_csv_is_read(light, written, tmp_path):
    path = written("scan.csv", "\n".join(echo(ROWS, light)))
    turned = f"0.0,0.0,{np.sin(0.125)},{np.cos(0.125)}"
    lines = [f"{int(t)},{round(t % 1 * 1e9)},odom,base_link,{p[0]},{p[1]},0.0,{turned}"
             for t, p in zip(TIMES, POSES, strict=True)]  # fmt: skip
    (tmp_path / "odom.csv").write_text("\n".join(line + ",0.0" * 78 for line in lines))
    log = load_log(path)
    assert np.array([scan.ranges for scan in log.scans]) == pytest.approx(RANGES)
    assert log.scans[0].angles[[0, -1]] == pytest.approx([-np.pi / 2, np.radians(89)])
    assert log.times == pytest.approx(TIMES) and log.poses == pytest.approx(POSES)
    path.write_text("\n".join(echo([row[:132] for row in ROWS], cut=["..."])))
    with pytest.raises(InputError, match="--full-length"):
        load_log(path)


def test_lines_of_other_kinds_are_said_to_be_left_out(written):
    path = written(
        "drive.txt", "".join(f"[scan]\n{k}\n{' '.join(r[4:])}\n" for k, r in enumerate(ROWS))
    )
    log = load_log(path)
    assert len(log) == COUNT and "all others are left out" in str(log.notes)


def test_two_columns_may_be_a_single_scan(written):
    bearings = np.radians(np.arange(-90, 90))
    scan = load_log(written("lidar.csv", joined(zip(bearings, RANGES[0], strict=True)))).scans[0]
    assert scan.ranges == pytest.approx(RANGES[0]) and scan.angles == pytest.approx(bearings)


def test_readings_of_a_fan_through_0_degrees_are_gathered_scan_by_scan(written):
    rows = [(f"{(b - 90) % 360}", r) for row in RANGES for b, r in enumerate(row)]
    log = load_log(written("lidar.csv", joined([["angle", "range"], *rows])))
    assert np.array([scan.ranges for scan in log.scans]) == pytest.approx(RANGES)
    assert log.scans[0].angles == pytest.approx(np.radians(np.arange(-90, 90)))


@pytest.mark.parametrize("scale", [1.0, np.pi / 180])
def test_readings_have_their_bearings_where_others_are_missing(scale, written):
    kept = np.random.default_rng(1).random(RANGES.shape) < 0.7
    bearings = scale * np.arange(-90, 90)
    readings = [
        {"angle": bearings[b], "distance": 100 * RANGES[k, b]} for k, b in np.argwhere(kept)
    ]
    path = written("lidar.json", json.dumps(readings))
    with pytest.raises(InputError, match="'ranges:cm'"):
        load_log(path)
    for scan, row, own in zip(load_log(path, format="ranges:cm").scans, RANGES, kept, strict=True):
        assert scan.ranges[scan.hits] == pytest.approx(row[own])
        assert np.degrees(scan.angles[scan.hits]) == pytest.approx(np.arange(-90, 90)[own])


def test_bearings_of_a_turn_give_a_beam_each(written):
    turns = np.arange(0.0, 360.0 * COUNT) + np.random.default_rng(2).normal(0.0, 0.05, 360 * COUNT)
    ranges = np.random.default_rng(1).uniform(1.0, 6.0, 360 * COUNT)
    lines = [f"{r:.3f} {b:.2f}" for r, b in zip(ranges, turns % 360.0, strict=True)]
    # A first reading that is no number is no name.
    log = load_log(written("lidar.txt", "\n".join(["inf 0.3", *lines[1:]])))
    assert len(log.scans[0].ranges) == 360 and np.isfinite(log.scans[5].ranges).mean() > 0.99


def test_arrays_of_one_scan_keep_their_bearings(tmp_path):
    bearings = np.radians(np.arange(180, 540) % 360)
    np.savez(tmp_path / "lidar.npz", ranges=np.resize(RANGES, 360), angles=bearings)
    log = load_log(tmp_path / "lidar.npz")
    assert len(log) == 1 and log.scans[0].ranges == pytest.approx(np.resize(RANGES, 360))


def test_a_record_without_its_stamp_or_its_scan_is_refused(written):
    rows = [{"t0": float(row[0]), "scan0": [*map(float, row[4:])]} for row in ROWS]
    rows[4]["t0"] = rows[7]["scan0"] = None
    log = load_log(written("drive.jsonl", "\n".join(map(json.dumps, rows))))
    assert len(log) == COUNT - 2 and log.bad_count == 2


def test_scans_of_points_may_have_fewer_or_none(written):
    rows = [{"time": float(row[0]), "scan": [
        {"angle": k - 90.0, "range": float(r)} for k, r in enumerate(row[4:])]}
        for row in ROWS]  # fmt: skip
    rows[3]["scan"] = rows[3]["scan"][:170]
    path = written("drive.jsonl", "\n".join(map(json.dumps, rows)))
    assert np.isfinite(load_log(path).scans[3].ranges).sum() == 170
    rows = [{"time": row["time"], "scan": [[*each.values()] for each in row["scan"]]}
            for row in rows]  # fmt: skip
    rows[-1]["scan"] = [[k - 90.0, None] for k in range(BEAMS)]
    path.write_text("\n".join(map(json.dumps, rows)))
    assert len(load_log(path)) == COUNT - 1


def test_columns_of_a_format_apply_to_a_table_with_lists(written):
    path = written(
        "drive.csv", "\n".join(["a,b,c,d,e", *(f'{",".join(row[:4])},"{row[4:]}"' for row in ROWS)])
    )
    log = load_log(path, format="stamp, x, y, theta, ranges:cm, first=-1.5, last=1.5")
    assert log.poses == pytest.approx(POSES) and log.scans[0].angles[0] == -1.5
    path.write_text("\n".join(json.dumps({"t": 1.0 * k, "ranges": [2.0]}) for k in range(9)))
    with pytest.raises(InputError, match="found by their names"):
        load_log(path, format="stamp, ranges")


def test_bearings_tell_scans_in_columns_from_scans_in_rows(tmp_path):
    bearings = np.tile(np.radians(np.arange(-90, 90)), (COUNT, 1))
    np.savez(tmp_path / "lidar.npz", r=RANGES.T, theta=bearings.T)
    assert [*map(len, (scan.ranges for scan in load_log(tmp_path / "lidar.npz").scans))] == (
        [BEAMS] * COUNT
    )


def test_advice_fits_what_lines_hold(written):
    path = written("drive.csv", joined([[*row[4:], "corridor"] for row in ROWS]))
    with pytest.raises(InputError, match=r"'ranges\*180@1'"):
        load_log(path)
    assert len(load_log(path, format="ranges*180@1")) == COUNT
    path.write_text(joined([[*row[4:-1], "null"] for row in ROWS]))
    assert len(load_log(path)) == COUNT
    # Poses are no readings.
    path.write_text(joined(POSES.tolist()))
    with pytest.raises(InputError, match=r"by --format$"):
        load_log(path)


def test_lines_longer_than_the_first_ones_are_not_cut(written):
    fans = [np.linspace(0.0, 300.0, count) for count in [40] * 70 + [52] * 30]
    pairs = ([(f"{bearing:.1f}", f"{2.0 + 0.01 * bearing:.2f}") for bearing in fan] for fan in fans)
    path = written("drive.csv", joined(np.ravel(each) for each in pairs))
    assert all(np.isfinite(scan.ranges[-1]) for scan in load_log(path).scans)
    path.write_text("1.0 2.0\n")
    with pytest.raises(InputError, match="2 columns"):
        load_log(path)


@pytest.mark.parametrize("head, line", [
    ("scan_id,angle,range", "{k},{a},{r}"),
    ("front_scan,angle,range", "{k},{a},{r}"),
    ("laser_scan,angle,distance_driven", "{r},{a},{k}.5"),
])  # fmt: skip
def test_a_column_that_counts_scans_holds_no_ranges(head, line, written):
    rows = [line.format(k=k, a=f"{np.radians(b):.5f}", r=r)
            for k, row in enumerate(RANGES) for b, r in enumerate(row)]  # fmt: skip
    log = load_log(written("points.csv", "\n".join([head, *rows])))
    assert np.array([scan.ranges for scan in log.scans]) == pytest.approx(RANGES)


@pytest.mark.parametrize("times", [5e-5 * np.arange(COUNT), 1.7e9 + np.arange(COUNT) // 6])
def test_stamps_that_hardly_rise_are_seconds(times, written):
    times = times + 1e-5 * np.arange(COUNT)
    rows = ([f"{t:.5f}", *row[1:]] for t, row in zip(times, ROWS, strict=True))
    path = written("drive.csv", joined([NAMES, *rows]))
    assert load_log(path).times == pytest.approx(times, abs=1e-5)


def test_what_looks_like_ranges_is_refused(written, tmp_path):
    grouped = [[f'"{400 * float(word):,.0f}"' for word in row[4:]] for row in ROWS]
    path = written("drive.csv", joined([NAMES[4:], *grouped]))
    with pytest.raises(InputError, match="grouped in thousands"):
        load_log(path)
    np.savez(tmp_path / "points.npz", scans=np.random.default_rng(0).uniform(-3, 3, (9, 40, 2)))
    with pytest.raises(InputError, match="without bearings"):
        load_log(tmp_path / "points.npz")
    # These go from left to right, as bearings do.
    across = np.tile(np.linspace(-4.0, 4.0, 40), (9, 1))
    ahead = np.random.default_rng(0).uniform(-3, 3, (9, 40))
    np.save(tmp_path / "points.npy", np.dstack([across, ahead]))
    with pytest.raises(InputError, match="without bearings"):
        load_log(tmp_path / "points.npy")
    # What only looks like either is read.
    rows = [[str(150 + k), *(f"{r:.3f}".replace(".", ",") for r in row)]
            for k, row in enumerate(RANGES)]  # fmt: skip
    path.write_text(joined([["time", *NAMES[4:]], *rows], ";"))
    assert load_log(path).scans[3].ranges == pytest.approx(RANGES[3])
    pairs = np.dstack([np.tile(np.radians(np.arange(-90, 90) // 2), (COUNT, 1)), 1e3 * RANGES])
    pairs[:, 5, 1] = 50.5
    np.savez(tmp_path / "points.npz", scans=np.pad(pairs, ((0, 0), (0, 50), (0, 0))))
    assert np.median(load_log(tmp_path / "points.npz").scans[0].ranges) < 6.0


def test_the_cosine_of_a_heading_is_no_heading(written):
    path = written("drive.csv", joined([[*NAMES[:3], "cos_theta", *NAMES[4:]], *ROWS]))
    assert not load_log(path).placed


def test_increments_and_times_between_scans_are_added_up(written):
    path = written("drive.csv", joined(["0.2", "0.05", "0.2", *row[4:]] for row in ROWS))
    log = load_log(path, format="dt:s@1, dx:m@2, dtheta:rad@3, ranges:m@4")
    assert log.times == pytest.approx(0.2 * np.arange(1, COUNT + 1))
    # Steps along chords of a circle, each along the heading of its middle.
    middles = 0.2 * np.arange(COUNT) + 0.1
    assert log.poses[-1] == pytest.approx(
        [0.05 * np.cos(middles).sum(), 0.05 * np.sin(middles).sum(), 0.2 * COUNT]
    )


def test_stamps_of_readings_are_no_messages(written):
    path = written("lidar.txt", "\n".join(
        f"stamp:{17 + k}00000000000000000,angle:{b}.0000,distance(mm):{1000 * r:.0f},intensity:212"
        for k, row in enumerate(RANGES) for b, r in enumerate(row)))  # fmt: skip
    assert load_log(path).scans[3].ranges == pytest.approx(RANGES[3])
