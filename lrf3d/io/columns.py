"""Scans from columns of numbers, as texts and files of arrays hold them, in whatever units.

Columns by what they hold enter: ranges (k, n), and, where there are any, stamps, poses, increments
or ticks of encoders (k,) each. A `LaserLog` leaves, whose notes say what was assumed.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from lrf3d.errors import InputError
from lrf3d.geometry import Float, sealed
from lrf3d.io.laser_log import LARGEST_RANGE, BadLine, LaserLog, WheelRecord, without_no_returns
from lrf3d.laser import LaserScan
from lrf3d.pose import Pose, compose

TIMES = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
LENGTHS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3}
ANGLES = {"rad": 1.0, "deg": np.pi / 180.0}
ROLES = {
    "stamp": TIMES, "x": LENGTHS, "y": LENGTHS, "theta": ANGLES, "dx": LENGTHS, "dy": LENGTHS,
    "dtheta": ANGLES, "left": {"": 1.0}, "right": {"": 1.0}, "ranges": LENGTHS, "angles": ANGLES,
}  # fmt: skip
"""What columns hold, and their units; the first one is that of lrf3d."""

SETTINGS = {
    "first": ANGLES, "last": ANGLES, "step": ANGLES, "tick": LENGTHS, "track": LENGTHS,
    "offset": LENGTHS,
}  # fmt: skip
"""Numbers that a format may give, and their units."""

SLOWEST = 5.0
"""Longest usual time between two scans [s], from which the unit of stamps is known."""

USUAL_INTERVAL = 0.1
"""Time between two scans [s] that is assumed where none have stamps."""

FAR, ROOM = 100.0, 1500.0
"""In metres, half of the ranges are below the first number; in centimetres, nine tenths are below
the second."""

LONGEST_STEP, LARGEST_STEP, TURN = 3.0, 0.35, 6.5
"""A robot that moves farther [m] or turns more [rad] from scan to scan, or turns further [rad] and
in such steps, has other units."""

FANS = {
    180: (-90, 89), 181: (-90, 90), 270: (-135, 134), 271: (-135, 135), 360: (0, 359),
    361: (-90, 90), 541: (-135, 135), 682: (-120, 120), 683: (-120, 120), 721: (-90, 90),
    1080: (-135, 135), 1081: (-135, 135), 1440: (0, 359.75),
}  # fmt: skip
"""First and last bearings [degrees] of usual range finders, by the number of their beams."""

COUNTER = 65536.0
"""What encoders with registers of 16 bits count to."""


@dataclass
class Columns:
    """Columns by what they hold, in units that may be known; others are found and noted."""

    name: str
    values: dict[str, Float]
    units: dict[str, str] = field(default_factory=dict)
    settings: dict[str, float] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    clockwise: bool = False

    def log(self, largest_range: float | None, bad: Sequence[BadLine], bad_count: int) -> LaserLog:
        """The log of these columns."""
        ranges, angles, times = self._ranges(), self._angles(), self._times()
        base = self._poses()
        offset = np.array([self.settings.get("offset", 0.0), 0.0, 0.0])
        poses = np.zeros((len(ranges), 3)) if base is None else compose(base, offset)
        limit = LARGEST_RANGE if largest_range is None else largest_range
        ranges = np.where(ranges >= limit, np.inf, ranges)
        scans = [
            LaserScan(Pose(*pose), angles, row, time=time)
            for pose, row, time in zip(poses.tolist(), ranges, times.tolist(), strict=True)
        ]
        note = ""
        if largest_range is None:
            scans, note = without_no_returns(scans)
        notes = self.notes + [note] * bool(note)
        wheels = None
        if base is not None and offset[0]:
            wheels = WheelRecord(times, base, np.arange(len(base)), float(offset[0]))
        return LaserLog(
            self.name, scans, bad_count, tuple(bad[:5]), "none" if base is None else "as logged",
            wheels=wheels, placed=base is not None, notes=tuple(notes),
        )  # fmt: skip

    def _in(self, role: str, guessed: str, why: str = "") -> Float:
        """A column in the units of lrf3d; a guessed unit is noted."""
        unit = self.units.get(role)
        if unit is None:
            unit = guessed
            self.notes.append(f"{role} in {unit}{why}")
        return self.values[role] * ROLES[role][unit]

    def _ranges(self) -> Float:
        values = self.values["ranges"]
        known = values[np.isfinite(values) & (values > 0.0)]
        if len(known) < 2 or np.ptp(known) == 0.0:
            what = f"all are {known[0]:g}" if len(known) else "none is a positive number"
            raise InputError(f"{self.name}: no ranges in it: {what}; name the columns by --format")
        whole = not (known % 1.0).any()
        unit, half, most = "m", float(np.median(known)), float(np.quantile(known, 0.9))
        if whole or half > FAR:
            unit = "mm"
            if "ranges" not in self.units and most < ROOM:
                raise InputError(
                    f"{self.name}: ranges of {half:g} by the median and up to {known.max():g}: name"
                    " their unit, --format 'ranges:mm', 'ranges:cm' or 'ranges:m'"
                )
        ranges = self._in("ranges", unit, f", {half:g} by the median")
        # Drivers write 0 or less for a beam that measured nothing.
        return np.where(ranges <= 0.0, -np.inf, np.where(np.isnan(ranges), np.inf, ranges))

    def _angles(self) -> Float:
        count = self.values["ranges"].shape[1]
        if "angles" in self.values:
            angles = self.values["angles"]
            if angles.shape != (count,):
                found = f"{len(angles)} angles for {count} ranges"
                raise InputError(f"{self.name}: {found}; expected one for each")
            in_degrees = np.ptp(angles) > 2.1 * np.pi or not (angles % 1.0).any()
            angles = self._in("angles", "deg" if in_degrees else "rad")
        else:
            angles = self._fan(count)
        if not 0.0 < np.ptp(angles) <= 2.1 * np.pi:
            wide = f"{count} beams over {np.degrees(np.ptp(angles)):g}°"
            raise InputError(f"{self.name}: {wide}; expected more than 0 and at most a turn")
        return sealed(-angles if self.clockwise else angles)

    def _fan(self, count: int) -> Float:
        first, last, step = (self.settings.get(key) for key in ("first", "last", "step"))
        if step is None and first is not None and last is not None:
            step = (last - first) / max(count - 1, 1)
        if step is None or (first is None and last is None):
            if count not in FANS:
                raise InputError(
                    f"{self.name}: {count} beams at unknown bearings; say which by --format, such"
                    " as 'first=-120deg, last=120deg'"
                )
            first, last = (float(np.radians(end)) for end in FANS[count])
            step = (last - first) / (count - 1)
            ends = f"{FANS[count][0]}° to {FANS[count][1]}°"
            self.notes.append(f"{count} beams from {ends} assumed, counter-clockwise")
        if first is None:
            first = float(last or 0.0) - step * (count - 1)
        return np.asarray(first + step * np.arange(count))

    def _times(self) -> Float:
        if "stamp" not in self.values:
            self.notes.append(f"no stamps: a scan each {USUAL_INTERVAL:g} s assumed")
            return USUAL_INTERVAL * np.arange(float(len(self.values["ranges"])))
        steps = np.abs(np.diff(self.values["stamp"]))
        usual = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 1.0
        guessed = next((unit for unit in TIMES if usual * TIMES[unit] <= SLOWEST), "ns")
        return self._in("stamp", guessed, f", {usual:g} apart")

    def _poses(self) -> Float | None:
        """Poses (k, 3) of the robot; None where there is no odometry."""
        has = self.values.keys()
        if {"left", "right"} <= has:
            return self._by_ticks()
        if {"dx", "dtheta"} <= has:
            steps = np.column_stack([self._in("dx", "m"), np.zeros(len(self.values["dx"]))])
            if "dy" in has:
                steps[:, 1] = self._in("dy", "m")
            return _driven(np.column_stack([steps, self._in("dtheta", "rad")]))
        if not {"x", "y", "theta"} <= has:
            return None
        moved = np.hypot(np.diff(self.values["x"]), np.diff(self.values["y"]))
        usual = float(np.quantile(moved, 0.9)) if len(moved) else 0.0
        unit = "mm" if usual > LONGEST_STEP else "m"
        theta = self.values["theta"]
        turned = np.abs(np.diff(theta))
        degrees = bool(np.abs(theta).max() > TURN and (turned > LARGEST_STEP).mean() > 0.05)
        x, y = self._in("x", unit), self._in("y", unit)
        theta = self._in("theta", "deg" if degrees else "rad")
        return np.column_stack([x, y, np.arctan2(np.sin(theta), np.cos(theta))])

    def _by_ticks(self) -> Float:
        tick, track = (self.settings.get(key) for key in ("tick", "track"))
        if tick is None or track is None:
            raise InputError(
                f"{self.name}: ticks of encoders; --format needs how far the robot moves with one,"
                " and how far apart its wheels are, such as 'tick=0.35mm, track=0.3m'"
            )
        left, right = (
            tick
            * np.diff(np.unwrap(self.values[side], period=COUNTER), prepend=self.values[side][0])
            for side in ("left", "right")
        )
        steps = np.column_stack([0.5 * (left + right), np.zeros(len(left)), (right - left) / track])
        return _driven(steps)


def _driven(steps: Float) -> Float:
    """Poses (k, 3) after each of the steps ahead, to the left [m] and turns [rad] (k, 3)."""
    theta = np.cumsum(steps[:, 2])
    # Each step runs along the heading of its middle.
    middle = theta - 0.5 * steps[:, 2]
    cos, sin = np.cos(middle), np.sin(middle)
    x = np.cumsum(cos * steps[:, 0] - sin * steps[:, 1])
    y = np.cumsum(sin * steps[:, 0] + cos * steps[:, 1])
    return np.column_stack([x, y, np.arctan2(np.sin(theta), np.cos(theta))])
