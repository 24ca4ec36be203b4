"""Table: the numbers of a recording by what they are, in whatever units, and the log of them.

Texts, arrays and documents are read into a table: ranges (k, n), and, where there are any, stamps,
poses, increments or ticks of encoders (k,) each. A `LaserLog` leaves, whose notes say what was
assumed.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from lrf3d.base.errors import InputError, one_line
from lrf3d.base.units import ANGLES, COUNTS, LENGTHS, NANO, TIMES
from lrf3d.geometry.lines import Float, Int, sealed, usual_step
from lrf3d.geometry.pose import Pose, compose, heading_of
from lrf3d.laser.scan import LARGEST_MEDIAN, LaserScan
from lrf3d.recordings.formats.text.fans import (
    FANS,
    LEAST_ALIKE,
    WHOLE_TURN,
    WIDEST_FAN,
    are_turns,
    beams_of,
    front_ends,
    in_one_piece,
)
from lrf3d.recordings.log import LARGEST_RANGE, UNTIMED, Intake, LaserLog, WheelRecord

# What columns hold, and their units; of these, the first one is that of lrf3d.
ROLES = {
    "stamp": TIMES, "dt": TIMES,
    "x": LENGTHS, "y": LENGTHS, "theta": ANGLES, "dx": LENGTHS, "dy": LENGTHS,
    "dtheta": ANGLES, "left": COUNTS, "right": COUNTS, "ranges": LENGTHS, "angles": ANGLES,
    "qx": COUNTS, "qy": COUNTS, "qz": COUNTS, "qw": COUNTS, "quality": COUNTS, "nanosec": COUNTS,
}  # fmt: skip

# The words of units.
UNITS = {unit for units in ROLES.values() for unit in units}

# Numbers that a format or a recording may give for all scans, and their units.
SETTINGS = {
    "first": ANGLES, "last": ANGLES, "step": ANGLES, "tick": LENGTHS, "track": LENGTHS,
    "offset": LENGTHS,
}  # fmt: skip

# Words for columns in headers, and for arrays.
SYNONYMS = {
    "stamp": "stamp time timestamp datetime t ts sec secs seconds zeit temps",
    "nanosec": "nanosec nanosecs nsec nsecs", "x": "x px posx",
    "y": "y py posy",
    "theta": "theta th yaw heading phi", "left": "left leftticks enc_left", "right": "right",
    "dx": "dx", "dy": "dy", "dtheta": "dtheta dyaw dth", "qx": "qx", "qy": "qy", "qz": "qz",
    "qw": "qw", "angles": "angle angule bearing azimuth winkel deg",
    "quality": "quality q confidence",
    "poses": "poses pose trajectory odometry odom",
    "ranges": "ranges range r distances distance dist d scan laser lidar readings"
    " abstand entfernung",
}  # fmt: skip

# Roles by these words.
ROLE_OF = {word: role for role, words in SYNONYMS.items() for word in words.split()}

# Roles of fields of ROS messages that are settings, or hold something else than their words say.
MESSAGE_FIELDS = {
    "angle_min": "first",
    "angle_max": "last",
    "min_theta": "first",
    "max_theta": "last",
    "angle_increment": "step",
} | dict.fromkeys(
    "scan_time time_increment range_min range_max seq frame_id child_frame_id z".split(), ""
)

# What stands for the elements that ``ros2 topic echo`` leaves out.
CUT = "..."

# What to do then.
WHOLE = "arrays are cut: ros2 topic echo --full-length prints them whole"

# Words of columns that are not poses, though they have an x and a y, or that count.
FOREIGN = set(
    "acceleration accel acc velocity vel twist gyro covariance id idx index number nr count"
    " intensity intensities".split()
)

# Ranges whose 90 % quantile is below this may be centimetres.
ROOM = 1500.0

# Least angle [°] from the first beam to the last: less is another number.
NARROWEST = 0.5

# Longest usual time between two scans [s], from which the unit of stamps is known.
SLOWEST = 5.0

# Days since 1900 of today's recordings: from 1954 to 2119.
DAYS = (20_000, 80_000)

# Usual distance between two poses [m] from which on they are in millimetres.
LONGEST_STEP = 3.0

# Largest usual turn from scan to scan [rad]: larger ones show degrees.
LARGEST_TURN = 0.35

# Share of turns that must be larger: a heading that jumps by a turn does so seldom.
LEAST_TURNS = 0.05

# Largest share of readings of a fan that may have the bearing of another.
MOST_ALIKE = 0.9

# Numbers that encoders with registers of 16 bits count.
COUNTER = 1 << 16


# Records repeat their names, and a header may have thousands of columns of one.
@lru_cache(1 << 12)
def meaning(name: str) -> tuple[str, str]:
    """What a column of this name holds, and its unit, as far as the name says so."""
    name = re.sub("(deg)rees?|(rad)ians?", r"\1\2", name.lower())
    if quaternion := re.search(r"(?:orientation|rotation|quaternion)\W?([wxyz])$", name):
        return f"q{quaternion[1]}", ""
    if (last := re.split("[./]", name)[-1]) in MESSAGE_FIELDS:
        return MESSAGE_FIELDS[last], "rad"
    words = [word for word in re.split(r"[^a-z]+", name) if word]
    if FOREIGN.intersection(words):
        return "", ""
    units = [word for word in words if word in UNITS]
    role = _role_of([word for word in words if word not in UNITS or len(words) == 1])
    return role, units[-1] if units and units[-1] in ROLES.get(role, {}) else ""


def _role_of(words: Sequence[str]) -> str:
    """The role of the last word that has one, in the singular or the plural; "" if none has."""
    for word in reversed(words):
        word = "stamp" if word.endswith("timestamp") else word
        if role := ROLE_OF.get(word) or ROLE_OF.get(word.removesuffix("s")):
            # The cosine or sine of a heading is not the heading.
            return "" if role == "theta" and words[0] in ("cos", "sin") else role
    return ""


def _planar(array: Float) -> Sequence[Float] | None:
    """The columns x, y and theta of poses (k, 3), (3, k), or matrices (k, 3, 3) or (k, 4, 4)."""
    if array.shape[1:] in ((3, 3), (4, 4)):
        return array[:, 0, -1], array[:, 1, -1], np.arctan2(array[:, 1, 0], array[:, 0, 0])
    if array.ndim != 2 or 3 not in array.shape:
        return None
    return [*(array.T if array.shape[1] == 3 else array)]


@dataclass
class Table:
    """Columns by what they hold, in units that may be known; others are found and noted."""

    intake: Intake
    values: dict[str, Float]
    units: dict[str, str] = field(default_factory=dict)
    settings: dict[str, float] = field(default_factory=dict)
    clockwise: bool = False
    fans: tuple[tuple[float, float], ...] = ()

    @classmethod
    def named(cls, intake: Intake, arrays: dict[str, Float]) -> "Table":
        """The table of arrays whose names say what they are."""
        table = cls(intake, {})
        unused = []
        for name, array in arrays.items():
            role, unit = meaning(name)
            # A list for each scan holds bearings, and no heading.
            role = {("theta", 2): "angles"}.get((role, array.ndim), role)
            if role == "poses" and (columns := _planar(array)) is not None:
                table.values |= dict(zip(("x", "y", "theta"), columns, strict=True)) | table.values
            elif role in SETTINGS and array.size and np.ptp(array) == 0.0:
                table.settings[role] = float(array.flat[0])
            elif role in ROLES and role not in table.values:
                table.values[role] = array if role == "ranges" else array.reshape(-1)
                table.units[role] = unit
            else:
                unused.append(f"{name} {array.shape}")
        intake.notes.append("found by name: " + ", ".join([*table.values, *table.settings]))
        intake.notes += [one_line(f"not used: {', '.join(unused)}", 200)] * bool(unused)
        return table

    def log(self) -> LaserLog:
        """The log of this table."""
        ranges = self.values["ranges"]
        if not ranges.size:
            raise InputError(f"{self.intake.path}: ranges {ranges.shape}: no scan in it")
        if self.values.get("angles", ranges[0]).shape == (ranges.size,) != ranges[0].shape:
            # Each scan has angles of its own; those with fewer are filled up.
            known = np.isfinite(self.values["angles"])
            self.values["angles"] = self.values["angles"][known]
            sizes = known.reshape(ranges.shape).sum(axis=1)
            self.gather(ranges.ravel()[known], np.append(0, np.cumsum(sizes)))
        ranges = self._ranges()
        angles = self._angles()
        times = self.times()
        for role, values in self.values.items():
            if role not in ("ranges", "angles") and len(values) != len(ranges):
                found = f"{len(values)} of {role} for {len(ranges)} scans"
                raise InputError(f"{self.intake.path}: {found}")
        base = self.poses()
        offset = np.array([self.settings.get("offset", 0.0), 0.0, 0.0])
        poses = np.zeros((len(ranges), 3)) if base is None else compose(base, offset)
        ranges = np.where(ranges >= (self.intake.largest_range or LARGEST_RANGE), np.inf, ranges)
        scans = [
            LaserScan(Pose(*pose), angles, row, time=time)
            for pose, row, time in zip(poses.tolist(), ranges, times.tolist(), strict=True)
        ]
        wheels = None
        if base is not None and offset[0]:
            wheels = WheelRecord(times, base, np.arange(len(base)), float(offset[0]))
        source = "none" if base is None else "as logged"
        return self.intake.log(
            scans, source=source, wheels=wheels, placed=base is not None, fans=self.fans
        )

    def gather(self, readings: Float, begins: Int | None = None) -> None:
        """Make scans of readings at bearings that differ from scan to scan, and may begin here.

        The beams are those of a fan; what was not measured is −inf.
        """
        angles = self.values["angles"]
        unit = self.units.get("angles") or ("deg" if np.abs(angles).max() > WIDEST_FAN else "rad")
        bearings = angles * ANGLES[unit]
        angles = in_one_piece(bearings)
        begins = self._begins(angles) if begins is None else begins
        sizes = np.diff(begins)
        kept = np.flatnonzero(2 * sizes > np.median(sizes))
        low = float(angles.min())
        wide = float(np.ptp(angles))
        whole = wide > WHOLE_TURN
        beams = beams_of(angles, begins)
        step = 2.0 * np.pi / beams if whole else wide / max(beams - 1, 1)
        cells = np.rint((angles - low) / (step or 1.0)).astype(int) % beams
        scans = np.repeat(np.arange(len(sizes)), sizes)
        # Of several returns that share a beam the first valid one counts.
        order = np.argsort(~(np.isfinite(readings) & (readings > 0.0)), kind="stable")
        places, first = np.unique((scans * beams + cells)[order], return_index=True)
        ranges = np.full((len(sizes), beams), -np.inf)
        ranges.flat[places] = readings[order[first]]
        dropped = len(readings) - len(places)
        if dropped > MOST_ALIKE * len(readings):
            found = f"{dropped:,} of {len(readings):,} readings have the bearing of another"
            raise InputError(f"{self.intake.path}: {found}: not the bearings of scans")
        self._thin(len(angles), begins[kept])
        self._thin(len(sizes), kept)
        # A scanner that turns may see nothing behind it; its bearings still count through there.
        self.clockwise |= "quality" in self.values and bool(whole or (angles != bearings).any())
        self.values["ranges"] = ranges[kept]
        self.values["angles"] = np.asarray(low + step * np.arange(beams))
        self.units["angles"] = "rad"
        way = "clockwise, as RPLIDARs with qualities" if self.clockwise else "counter-clockwise"
        beside = f", and {dropped:,} readings dropped that share a beam" * (dropped > 0)
        self.intake.notes.append(
            f"bearings in {unit}, {way}: gathered to {len(kept)} scans of {beams} beams;"
            f" {len(sizes) - len(kept)} partial scans left out{beside}"
        )

    def _thin(self, count: int, kept: Int) -> None:
        """Keep some rows of the columns that have so many."""
        thin = {role: each[kept] for role, each in self.values.items() if len(each) == count}
        self.values |= thin

    def _begins(self, bearings: Float) -> Int:
        """Where the scans of single readings begin (k + 1,), with the end of the last."""
        stamps = self.values.get("stamp", np.empty(0))
        # A scan begins with another stamp, or where the bearings start again.
        steps = np.diff(bearings)
        again = np.abs(steps) > 0.5 * np.ptp(bearings)
        changed = np.diff(stamps) != 0.0
        if len(stamps) and 2 * len(np.unique(stamps)) < len(stamps):
            # Scans with stamps of their own have most bearings, and hardly one of them twice.
            scans = np.append(0, np.cumsum(changed))
            most = 2 * len(stamps) > len(np.unique(bearings)) * (scans[-1] + 1)
            own = most and len(np.unique(WIDEST_FAN * scans + bearings)) > LEAST_ALIKE * len(stamps)
            again = again if not own and are_turns(steps, again, changed) else changed
        return np.concatenate([[0], np.flatnonzero(again) + 1, [len(bearings)]])

    def _in(self, role: str, guessed: str, why: str = "") -> Float:
        """A column in the units of lrf3d; a guessed unit is noted."""
        if not self.units.get(role):
            self.intake.notes.append(f"{role} in {guessed}{why}")
        return self.values[role] * ROLES[role][self.units.get(role) or guessed]

    def _ranges(self) -> Float:
        values = self.values["ranges"]
        path = self.intake.path
        known = values[np.isfinite(values) & (values > 0.0)]
        if len(known) < 2 or np.ptp(known) == 0.0:
            what = f"all are {known[0]:g}" if len(known) else "none is a positive number"
            raise InputError(f"{path}: no ranges in it: {what}; name the columns by --format")
        half, most = np.quantile(known, [0.5, 0.9])
        unit = "m" if (known % 1.0).any() and half <= LARGEST_MEDIAN else "mm"
        # RPLIDARs, which have qualities, write millimetres.
        known_unit = self.units.get("ranges") or "quality" in self.values
        if unit == "mm" and not known_unit and most < ROOM:
            raise InputError(
                f"{path}: ranges of {half:g} by the median and up to {known.max():g}: name"
                " their unit, --format 'ranges:mm', 'ranges:cm' or 'ranges:m'"
            )
        ranges = self._in("ranges", unit, f", {half:g} by the median")
        # Drivers write 0 or less for a beam that measured nothing.
        return np.where(ranges <= 0.0, -np.inf, np.where(np.isnan(ranges), np.inf, ranges))

    def _angles(self) -> Float:
        count = self.values["ranges"].shape[1]
        path = self.intake.path
        angles = self.values.get("angles")
        if angles is None:
            angles = self._fan(count)
        elif angles.shape != (count,):
            found = f"{len(angles)} angles for {count} ranges"
            raise InputError(f"{path}: {found}; expected one for each")
        else:
            in_degrees = np.ptp(angles) > WIDEST_FAN or not (angles % 1.0).any()
            angles = self._in("angles", "deg" if in_degrees else "rad")
        if not np.radians(NARROWEST) < np.ptp(angles) <= WIDEST_FAN:
            wide = f"{count} beams over {np.degrees(np.ptp(angles)):g}°"
            raise InputError(f"{path}: {wide}; expected more than {NARROWEST}° and at most a turn")
        return sealed(-angles if self.clockwise else angles)

    def _fan(self, count: int) -> Float:
        first, last, step = (self.settings.get(key) for key in ("first", "last", "step"))
        if step is None and first is not None and last is not None:
            step = (last - first) / max(count - 1, 1)
        if step is None or (first is None and last is None):
            return self._usual_fan(count)
        if first is None:
            first = float(last or 0.0) - step * (count - 1)
        return np.asarray(first + step * np.arange(count))

    def _usual_fan(self, count: int) -> Float:
        """The bearings of a usual range finder with this number of beams."""
        if count not in FANS:
            raise InputError(
                f"{self.intake.path}: {count} beams at unknown bearings; say which by --format,"
                " such as 'first=-120deg, last=120deg'"
            )
        first, last = (float(np.radians(end)) for end in FANS[count])
        # Half a turn may be a whole one, and the other way round.
        half = last - first <= np.pi
        if half or last - first > WHOLE_TURN:
            self.fans = (front_ends(count, 2.0 * np.pi if half else np.pi),)
        self.intake.notes.append(
            f"{count} beams from {FANS[count][0]}° to {FANS[count][1]}° assumed, counter-clockwise"
        )
        return np.asarray(first + (last - first) / (count - 1) * np.arange(count))

    def times(self) -> Float:
        """Stamps (k,) [s]."""
        nanosec = self.values.pop("nanosec", None)
        if nanosec is not None:
            seconds = self.values.get("stamp", 0.0 * nanosec)
            # Stamps with a fraction are complete, and so are those in smaller units.
            if usual_step(seconds) <= SLOWEST:
                self.values["stamp"] = seconds + NANO * nanosec * (not (seconds % 1.0).any())
                self.units["stamp"] = "s"
        if "stamp" not in self.values and "dt" in self.values:
            return np.cumsum(self._in("dt", "s"))
        if "stamp" not in self.values:
            self.intake.notes.append(f"no stamps: a scan each {UNTIMED:g} s assumed")
            return UNTIMED * np.arange(float(len(self.values["ranges"])))
        usual = usual_step(self.values["stamp"]) or 1.0
        return self._in("stamp", _unit_of(self.values["stamp"], usual), f", {usual:g} apart")

    def poses(self) -> Float | None:
        """Poses (k, 3) of the robot; None where there is no odometry."""
        has = self.values.keys()
        if {"left", "right"} <= has:
            return self._by_ticks()
        if {"dx", "dtheta"} <= has:
            ahead = self._in("dx", "m")
            left = self._in("dy", "m") if "dy" in has else 0.0 * ahead
            return _driven(ahead, left, self._in("dtheta", "rad"))
        # Turns in the plane have two of the four numbers.
        if "theta" not in has and {"qz", "qw"} <= has:
            flat = np.zeros(len(self.values["qz"]))
            turns = (self.values.get(name, flat) for name in ("qx", "qy", "qz", "qw"))
            self.values["theta"] = heading_of(*turns)
            self.units["theta"] = "rad"
        if {"x", "y", "theta"} <= has:
            return self._absolute()
        if lone := sorted({"x", "y", "theta"} & has):
            self.intake.notes.append(f"{', '.join(lone)} alone are no poses: not used")
        return None

    def _absolute(self) -> Float:
        """Poses (k, 3) by x, y and theta, whose units show from scan to scan."""
        moved = np.hypot(np.diff(self.values["x"]), np.diff(self.values["y"]))
        unit = "mm" if len(moved) and np.quantile(moved, 0.9) > LONGEST_STEP else "m"
        turned = np.abs(np.diff(self.values["theta"])) > LARGEST_TURN
        # Headings of more than a turn may be in degrees, or go on.
        wide = np.abs(self.values["theta"]).max() > WIDEST_FAN
        x = self._in("x", unit)
        y = self._in("y", unit)
        theta = self._in("theta", "deg" if wide and turned.mean() > LEAST_TURNS else "rad")
        return np.column_stack([x, y, np.arctan2(np.sin(theta), np.cos(theta))])

    def _by_ticks(self) -> Float:
        tick, track = (self.settings.get(key) for key in ("tick", "track"))
        if tick is None or track is None:
            raise InputError(
                f"{self.intake.path}: ticks of encoders; --format needs how far the robot moves"
                " with one, and how far apart its wheels are, such as 'tick=0.35mm, track=0.3m'"
            )
        ticks = np.column_stack([self.values["left"], self.values["right"]])
        rolled = tick * np.diff(np.unwrap(ticks, axis=0, period=COUNTER), axis=0, prepend=ticks[:1])
        ahead = rolled.mean(axis=1)
        turns = (rolled[:, 1] - rolled[:, 0]) / track
        return _driven(ahead, 0.0 * ahead, turns)


def _unit_of(stamps: Float, usual: float) -> str:
    """The unit of stamps at usual steps: days since 1900, as in spreadsheets, rise slowly."""
    are_days = len(stamps) and DAYS[0] < stamps.min() and stamps.max() < DAYS[1]
    if are_days and max(usual, np.ptp(stamps) / len(stamps)) * TIMES["days"] <= SLOWEST:
        return "days"
    return next((unit for unit in TIMES if usual * TIMES[unit] <= SLOWEST), "ns")


def _driven(ahead: Float, left: Float, turns: Float) -> Float:
    """Poses (k, 3) after each of the steps ahead and to the left [m], with turns [rad] (k,)."""
    theta = np.cumsum(turns)
    # Each step runs along the heading of its middle.
    middle = theta - 0.5 * turns
    cos = np.cos(middle)
    sin = np.sin(middle)
    x = np.cumsum(cos * ahead - sin * left)
    y = np.cumsum(sin * ahead + cos * left)
    return np.column_stack([x, y, np.arctan2(np.sin(theta), np.cos(theta))])


def padded(rows: list[Float], notes: list[str], *, spread: bool = False) -> Float:
    """Ranges (k, n) of scans that may have fewer, between the same bearings if they are spread.

    What is missing is not measured, −inf.
    """
    beams = int(np.median([len(row) for row in rows])) if spread else max(map(len, rows))
    ranges = np.full((len(rows), beams), -np.inf)
    for row, values in zip(ranges, rows, strict=True):
        places = np.arange(len(values))
        if spread and len(values) > 1:
            places = np.rint(places * (beams - 1) / (len(values) - 1)).astype(np.int64)
        row[places] = values
    if short := sum(len(values) < beams for values in rows):
        notes.append(
            f"{short} scans with fewer than {beams} ranges: what is missing is not measured"
        )
    return ranges
