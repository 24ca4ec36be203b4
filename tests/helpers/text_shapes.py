"""Drives of different robots, and their logs as text in the shapes that programs write.

A shape is a function of a drive that returns the text of its log; those that leave out what a
reader needs have a format, too.
"""

import json
import re
from dataclasses import dataclass
from datetime import UTC, datetime

import numpy as np


@dataclass(frozen=True)
class Drive:
    """A robot in a room of 8 m by 6 m: a range finder, how often it scans, and for how long."""

    beams: int
    first: float
    last: float
    rate: float
    count: int = 24
    farthest: float = 30.0

    @property
    def angles(self):
        return np.radians(np.linspace(self.first, self.last, self.beams))

    @property
    def times(self):
        return 1700000000.0 + np.arange(self.count) / self.rate

    @property
    def poses(self):
        steps = np.arange(float(self.count))
        return np.column_stack([0.1 * steps - 2, 0 * steps, 0.25 * steps - 1])

    @property
    def ranges(self):
        """Ranges (k, n) to the walls [m]; beyond the farthest one there is no return, NaN."""
        x, y, theta = (column[:, None] for column in self.poses.T)
        heading = self.angles + theta
        with np.errstate(divide="ignore"):
            along = np.where(np.cos(heading) > 0, 4.0 - x, 4.0 + x) / np.abs(np.cos(heading))
            across = np.where(np.sin(heading) > 0, 3.0 - y, 3.0 + y) / np.abs(np.sin(heading))
        ranges = np.minimum(along, across)
        return np.where(ranges < self.farthest, ranges, np.nan)


SICK = Drive(181, -90, 90, 10.0, 40)
S300 = Drive(541, -135, 135, 12.5)
URG = Drive(682, -120, 120, 10.0, farthest=4.0)
UST = Drive(1081, -135, 135, 40.0)
LDS = Drive(360, 0, 359, 5.5)
RPLIDAR = Drive(720, 0, 359.5, 7.0, 16)
ROBOTS = {"SICK": SICK, "S300": S300, "UST": UST, "LDS": LDS}


def lines(columns, separator=" ", header=None, form="{:.6f}"):
    """The rows of columns, a line each."""
    rows = [separator.join(map(form.format, row)) for row in np.column_stack(columns)]
    return "\n".join([*([] if header is None else [header]), *rows]) + "\n"


def names(drive, mark, separator, *first):
    """A header: names, and one for each beam."""
    return separator.join([*first, *(mark.format(k) for k in range(drive.beams))])


def parts(drive):
    return drive.times, drive.poses, drive.ranges


def bare(drive):
    return lines(parts(drive))


def decimal_commas(drive):
    header = names(drive, "Abstand_{}", ";", "Zeit", "x", "y", "Winkel")
    return lines(parts(drive), ";", header).replace(".", ",")


def a_header(drive):
    times, poses, ranges = parts(drive)
    header = ",".join([names(drive, "range_{}", ",", "time_ms"), "x", "y", "yaw"])
    return lines([1e3 * times, ranges, poses], ",", header)


def joined_files(drive):
    """Two files with headers, one after the other."""
    header = names(drive, "r{}", ",", "Time", "x", "y", "theta")
    return "".join(
        lines([part[rows] for part in parts(drive)], ",", header)
        for rows in (slice(0, 9), slice(9, None))
    )


def millimetres(drive):
    times, poses, ranges = parts(drive)
    header = names(drive, "r[{}] (mm)", ";", "stamp_us", "x [mm]", "y [mm]", "theta (deg)")
    columns = [1e6 * times, 1e3 * poses[:, :2], np.degrees(poses[:, 2:]), 1e3 * ranges]
    return lines(columns, ";", header)


def times_of_day(drive):
    return re.sub(
        r"(?m)^\S+",
        lambda m: f"{datetime.fromtimestamp(float(m[0]), UTC):%Y/%m/%d %H:%M:%S.%f}",
        bare(drive),
    )


def nanoseconds(drive):
    times, poses, ranges = parts(drive)
    return lines([1e9 * (times - times[0]), poses, 1e3 * ranges], " ", None, "{:.3f}")


def a_list_in_a_cell(drive):
    return "time,ranges,x,y,theta\n" + "\n".join(
        f'{t},"[{", ".join(map(str, r))}]",{",".join(map(str, p))}'
        for t, p, r in zip(*(part.tolist() for part in parts(drive)), strict=True)
    )


def rostopic_echo(drive):
    """Scans as `rostopic echo -b drive.bag -p /scan` prints them, and poses that were added."""
    head = names(drive, "field.ranges{}", ",", "%time", "field.header.seq", "field.header.stamp",
                 "field.header.frame_id", "field.angle_min", "field.angle_max",
                 "field.angle_increment")  # fmt: skip
    fan = f"laser,{drive.angles[0]},{drive.angles[-1]},{drive.angles[1] - drive.angles[0]}"
    rows = [
        f"{1e9 * t:.0f},{k},{1e9 * t:.0f},{fan},{','.join(map(str, r))},{','.join(map(str, p))}"
        for k, (t, p, r) in enumerate(zip(*(part.tolist() for part in parts(drive)), strict=True))
    ]
    return "\n".join([f"{head},x,y,theta", *rows])


def bagpy(drive):
    """Scans as bagpy's `message_by_topic` writes them, and poses that were added."""
    head = names(drive, "ranges_{}", ",", "Time", "header.seq", "header.stamp.secs",
                 "header.stamp.nsecs", "header.frame_id", "angle_min", "angle_max",
                 "angle_increment", "time_increment", "scan_time", "range_min",
                 "range_max")  # fmt: skip
    fan = f"laser,{drive.angles[0]},{drive.angles[-1]},{drive.angles[1] - drive.angles[0]}"
    rows = [
        f"{t},{k},{int(t)},{round(t % 1 * 1e9)},{fan},0.0,{1 / drive.rate},0.05,30.0,"
        f"{','.join(map(str, r))},{','.join(map(str, p))}"
        for k, (t, p, r) in enumerate(zip(*(part.tolist() for part in parts(drive)), strict=True))
    ]
    return "\n".join([f"{head},x,y,theta", *rows])


def json_lines(drive):
    """A record a line; what was not measured is null."""
    return "\n".join(
        json.dumps({"stamp": t, "pose": dict(zip(("x", "y", "theta"), p, strict=True)),
                    "angle_min": drive.angles[0], "angle_increment": drive.angles[1]
                    - drive.angles[0], "ranges": [None if v != v else v for v in r]})
        for t, p, r in zip(*(part.tolist() for part in parts(drive)), strict=True)
    )  # fmt: skip


def numpy_prints(drive):
    """Rows of an array as `print` shows them, over several lines each."""
    rows = np.column_stack([drive.times - drive.times[0], drive.poses, drive.ranges])
    with np.printoptions(threshold=10**6, precision=6, suppress=True, linewidth=90):
        return "\n".join(map(str, rows))


def numpy_print(drive):
    """A whole array as `print` shows it, a row in each line."""
    with np.printoptions(threshold=10**6, precision=6, suppress=True, linewidth=10**6):
        return str(np.column_stack([drive.times - drive.times[0], drive.poses, drive.ranges]))


def with_words(nothing, far):
    """Rows with a word where nothing was measured, and another one for what is too far."""

    def write(drive):
        table = bare(drive).replace("nan", nothing)
        return re.sub(rf"{nothing} {nothing}", f"{nothing} {far}", table)

    return write


def encoder_ticks(drive):
    """Stamps [µs], ticks of encoders, other sensors, and ranges [mm] from column 25, 0 for none."""
    ticks = 17000 + np.cumsum(np.full((drive.count, 2), [90.0, 100.0]), axis=0)
    others = np.tile([0.0, 170.0, 255.0, 0.0], (drive.count, 5))
    ranges = np.nan_to_num(1e3 * drive.ranges)
    stamps = 212387282 + 1e6 / drive.rate * np.arange(drive.count)
    return lines([stamps, 0 * stamps, ticks % 65536, others, ranges], form="{:.0f}")


def counted_ranges(drive):
    """Lines of a word, a stamp [ms], the number of ranges, and these [mm]."""
    rows = np.nan_to_num(1e3 * drive.ranges)
    stamps = 315 + 1e3 / drive.rate * np.arange(drive.count)
    return "\n".join(
        f"S {stamp:.0f} {len(row)} {' '.join(map('{:.0f}'.format, row))}"
        for stamp, row in zip(stamps, rows, strict=True)
    )


def pairs(drive):
    """An angle and a range in each line; what was not measured has none."""
    bearings = np.degrees(drive.angles)
    return "angle,distance\n" + "\n".join(
        f"{angle:.4f},{reading:.4f}"
        for row in drive.ranges
        for angle, reading in zip(bearings, row, strict=True)
    )


def by_turns(drive, order=1):
    """A scan a line, of which each range has its bearing before it, or after it if order is −1."""
    times, poses, ranges = parts(drive)
    bearings = np.tile(np.degrees(drive.angles), (len(ranges), 1))
    turns = np.dstack([bearings, ranges][::order])
    return lines([times, poses, turns.reshape(len(ranges), -1)], ",")


def rosbag_to_csv(drive):
    """Whole nanoseconds, the stamp in two parts, and a scan in a cell, separated by spaces."""
    rows = [
        f'{1e9 * t:.0f},{int(t)},{round(t % 1 * 1e9)},"{" ".join(map(str, r))}",{x},{y},{turn}'
        for t, (x, y, turn), r in zip(*(part.tolist() for part in parts(drive)), strict=True)
    ]
    return "\n".join(["rosbagTimestamp,secs,nsecs,ranges,x,y,theta", *rows])


def plot_juggler(drive):
    """Two topics in one table: what a line does not hold is blank."""
    times, poses, ranges = parts(drive)
    header = names(
        drive, "/scan/ranges[{}]", ",", "__time", *map("/odom/{}".format, "x y yaw".split())
    )
    rows = [
        f"{time},{','.join(map(str, pose))}{',' * drive.beams}\n{time},,,,{','.join(map(str, row))}"
        for time, pose, row in zip(np.ravel(times), poses.tolist(), ranges.tolist(), strict=True)
    ]
    return "\n".join([header, *rows])


def named_in_units(drive):
    """A header, and below it a row of units."""
    header, rest = a_header(drive).split("\n", 1)
    units = ["ms", *["m"] * (drive.beams + 2), "rad"]
    return f"{header}\n{','.join(units)}\n{rest}"


def poses_last(drive):
    """Rows of a stamp, ranges and a pose."""
    times, poses, ranges = parts(drive)
    return lines([times, ranges, poses])


# Shapes with stamps and poses, whose bearings are those of a usual range finder.
PLACED = {
    "vertical bars": lambda drive: lines(parts(drive), "|"),
    "a row of units": named_in_units,
    "poses after the ranges": poses_last,
    "bearings and ranges by turns": by_turns,
    "ranges and bearings by turns": lambda drive: by_turns(drive, order=-1),
    "a whole scan in a cell": rosbag_to_csv,
    "a merged table with blanks": plot_juggler,
    "a merged table, scans first": lambda drive: re.sub(
        r"(?m)^([^,]*),([^,]*),([^,]*),([^,]*),(.*)$", r"\1,\5,\2,\3,\4", plot_juggler(drive)
    ),
    "bare numbers": bare,
    "semicolons, decimal commas": decimal_commas,
    "a header": a_header,
    "two files that were joined": joined_files,
    "millimetres, degrees": millimetres,
    "times of day": times_of_day,
    "nanoseconds": nanoseconds,
    "a list in a cell": a_list_in_a_cell,
    "a list over several lines of a cell": lambda drive: re.sub(
        "(?<=[0-9]), (?=[0-9])", " \n", a_list_in_a_cell(drive)
    ),
    "rostopic echo -p": rostopic_echo,
    "bagpy": bagpy,
    "JSON lines": json_lines,
    "numpy prints": numpy_prints,
    "a numpy print": numpy_print,
    "commas": lambda drive: lines(parts(drive), ","),
    "tabs": lambda drive: lines(parts(drive), "\t"),
    "spaces, decimal commas": lambda drive: bare(drive).replace(".", ","),
    "a comment": lambda drive: lines(
        parts(drive), " ", "# t x y theta " + "r " * drive.beams
    ),
    "NaN and inf": with_words("NaN", "inf"),
    "Infinity": with_words("nan", "-Infinity"),
    "null": with_words("null", "inf"),
    "n/a": with_words("N/A", "inf"),
}  # fmt: skip
