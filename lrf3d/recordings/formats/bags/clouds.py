"""Point clouds of bags as scans: in each direction the nearest point of one ring or of a band.

Messages of ``sensor_msgs/PointCloud2`` enter; scans in the level frame of the lidar leave. Which
points make a scan is decided in this order:

- a band of heights that the user gives, in the frame of the robot, or in that of the lidar if it is
  not known where the lidar is mounted;
- the ring nearest to the level, where points have rings and one of them is about level;
- a band around the height of the lidar; where the layers of points are unknown, it widens upwards
  with the distance, so that one of them is in it at any distance, and a level floor is not.

Points have times where a field has a usual name for them and its values fit one revolution.
"""

import base64
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from lrf3d.base.balance import Balance
from lrf3d.base.errors import InputError, one_line
from lrf3d.base.text import counted
from lrf3d.base.units import NANO, TIMES
from lrf3d.geometry.lines import LARGEST_COORDINATE, ROUNDING, Bool, Float, Int, Records, wrap_angle
from lrf3d.laser import LaserScan
from lrf3d.messages.clouds import OPTICAL_AXES, POINT_FIELDS
from lrf3d.recordings.log import FINEST

# Names that drivers give to the number of a point's layer and to its time.
RINGS = ("ring", "channel", "laser_id", "line")
STAMPS = ("time", "t", "timestamp", "offset_time", "time_offset", "timestamps", "time_stamp")

# Floats that are rings: lidars have up to 300.
POSSIBLE_RINGS = np.arange(1000)

# [s] The longest revolution: lidars make three or more in a second.
LONGEST_SWEEP = 0.35

# [s] Times of points that differ from the stamp by more are by another clock.
SAME_CLOCK = 1.0

# [rad] How far bearings may be from even turning, by their root mean square: lasers of one column
# look some degrees to the left and the right.
UNEVEN = 0.15

# [rad] The steepest elevation of a ring that stands for the level plane: 0.5 m in 10 m.
LEVEL = 0.05

# The share of a ring's points that has to be level.
MOST = 0.9

# [m] Half the height of the band around a lidar without a level ring.
HALF_BAND = 0.2

# [m] Upper bound on the spread of heights in clouds of planar lasers, in the frame of the robot.
FLAT = 0.05

# Largest mean number of points of planar lasers in a usual step of bearings: a fine laser has four,
# and two of them may share a cloud.
MOST_FLAT = 8

# [rad] The largest elevation of the first layer above the level: layers are up to 2.2° apart, so
# one is within 1.1° of it, and a little more.
RISE = 0.021

# Number of points of a ring from which the step of its bearings is known.
ENOUGH = 30

# [rad] The step of bearings where it is unknown, and the finest one.
USUAL_STEP = float(np.radians(0.5))
FINEST_STEP = float(np.radians(0.05))


class CloudPoints(NamedTuple):
    """Points (n, 3) [m] of a message, their rings (n,) and their times (n,), if they have any."""

    places: Float
    rings: Int | None
    times: Float | None


def cloud_points(message: Any) -> CloudPoints:
    """The points of a PointCloud2, whatever its layout; raises InputError if it is unusable."""
    rows = _rows(message)
    names = rows.dtype.names or ()
    if not {"x", "y", "z"} <= {*names} or any(rows[name].dtype.kind != "f" for name in "xyz"):
        there = one_line(", ".join(names), 80)
        raise InputError(f"a cloud without x, y and z as floats; its fields are {there or 'none'}")
    places = np.column_stack([rows[name].astype(np.float64) for name in "xyz"])
    times = _first(rows, STAMPS)
    return CloudPoints(places, _rings(rows), None if times is None else times.astype(np.float64))


def _rings(rows: Records) -> Int | None:
    """The rings of points, which programs that convert clouds may write as floats."""
    found = _first(rows, RINGS)
    if found is None or not (found.dtype.kind in "iu" or np.isin(found, POSSIBLE_RINGS).all()):
        return None
    return np.asarray(found, dtype=np.int64)


def _first(rows: Records, known: Sequence[str]) -> Any:
    """The first of some fields that points have; None if they have none of them."""
    return next((rows[name] for name in known if name in (rows.dtype.names or ())), None)


def _rows(message: Any) -> Records:
    """The points of a message as records (n,) of its fields."""
    kind = _record_of(message)
    step = kind.itemsize
    # In JSON, bytes are a text or a list of numbers.
    text = isinstance(message.data, str)
    data = base64.b64decode(message.data) if text else np.asarray(message.data, np.uint8).tobytes()
    height = int(message.height)
    width = int(message.width)
    # Rows may be padded; drivers that write a wrong length of rows do not pad them.
    length = int(message.row_step)
    if length < width * step or length * height > len(data):
        length = width * step
    if length * height > len(data):
        expected = f"{height} x {width} points of {step} bytes"
        raise InputError(f"a cloud of {len(data)} bytes, too few for {expected}")
    table = np.frombuffer(data, np.uint8, length * height).reshape(height, length)
    return np.ascontiguousarray(table[:, : width * step]).reshape(-1).view(kind)


def _record_of(message: Any) -> np.dtype[Any]:
    """The layout of the points of a message; of fields with the same name the first counts.

    Some drivers write names in capitals.
    """
    order = ">" if message.is_bigendian else "<"
    step = int(message.point_step)
    fields = {each.name.lower(): each for each in reversed(message.fields) if each.name}
    formats = []
    for name, each in fields.items():
        if each.datatype not in POINT_FIELDS:
            raise InputError(f"a cloud whose field {name!r} has the type {each.datatype}")
        formats.append(order + POINT_FIELDS[each.datatype])
        if int(each.offset) + np.dtype(formats[-1]).itemsize > step:
            raise InputError(f"a cloud with points of {step} bytes, shorter than their fields")
    offsets = [int(each.offset) for each in fields.values()]
    layout = {"names": [*fields], "formats": formats, "offsets": offsets, "itemsize": step}
    return np.dtype(layout)  # type: ignore[call-overload,no-any-return]


class Turning(NamedTuple):
    """Where the first beam of a scan looks [rad], which way it turns (±1), and when it is sent.

    The time of a turn is 0 [s] where it is unknown; then ``positions`` (n,) are bearings of points
    from the first beam on, within one turn.
    """

    first: float
    way: float
    positions: Float
    begins: float = 0.0
    period: float = 0.0


@dataclass(slots=True)
class CloudScans:
    """Makes scans of the clouds of one lidar, which all have the same rings and bearings.

    Args:
        topic: Its topic.
        level: Its axes (3, 3) in its level frame.
        height: Its height above the robot's frame [m]; 0 if it is unknown.
        base: The robot's frame; "" if it is not known where the lidar is mounted.
        band: Least and largest height of points that make scans [m], if the user gave them.
    """

    topic: str
    level: Float
    height: float
    base: str
    band: Sequence[float] | None
    balance: Balance = field(default_factory=lambda: Balance("point"))
    _ring: int | None = None
    _beams: int = 0
    _words: str = ""
    _clouds: int = 0
    _still: int = 0
    _rises: bool = False

    def scan(self, message: Any, stamp: int) -> tuple[LaserScan, int]:
        """The scan of a message, and when its first beam was sent [ns]; see `cloud_points`."""
        points = cloud_points(message)
        ranges = np.linalg.norm(points.places, axis=1)
        valid = (ranges > 0.0) & (ranges < LARGEST_COORDINATE)
        self.balance.all += len(valid)
        self.balance.leave("invalid point", int((~valid).sum()))
        if not valid.any():
            raise InputError("a cloud without points")
        places, rings, times = (None if each is None else each[valid] for each in points)
        x, y, z = self.level @ places.T  # type: ignore[union-attr]
        bearings = np.arctan2(y, x)
        if not self._beams:
            self._choose(np.column_stack([x, y, z]), bearings, rings)
        chosen = self._chosen(x, y, z, rings)
        outside = "point of other heights" if self._ring is None else "point of another ring"
        self.balance.leave(outside, int((~chosen).sum()))
        turning = self._turning(bearings, times, NANO * stamp)
        step = 2.0 * np.pi / self._beams
        beams = np.floor(turning.positions / step + 0.5).astype(np.int64)
        if not turning.period:
            beams %= self._beams
        inside = (beams >= 0) & (beams < self._beams)
        self.balance.leave("surplus point", int((chosen & ~inside).sum()))
        found = np.full(self._beams, -np.inf)
        if self._ring is not None:
            # Other rings show that the lidar looked there, and its level one met nothing.
            found[beams[inside]] = np.inf
        angles: Float = turning.first + turning.way * step * np.arange(
            self._beams, dtype=np.float64
        )
        kept = np.flatnonzero(chosen & inside)
        # The nearest point of each beam comes first.
        away = np.hypot(x[kept], y[kept])
        order = np.lexsort((away, beams[kept]))
        met, places_met = np.unique(beams[kept][order], return_index=True)
        nearest = order[places_met]
        found[met] = away[nearest]
        angles[met] += wrap_angle(bearings[kept[nearest]] - angles[met])
        self.balance.used += len(met)
        self.balance.leave("hidden point", len(kept) - len(met))
        begins = stamp + round(turning.begins / NANO)
        increment = turning.period / self._beams
        scan = LaserScan(
            (0.0, 0.0, 0.0), angles, found, time=NANO * begins,
            time_increment=increment,
        )  # fmt: skip
        return scan, begins

    @property
    def words(self) -> str:
        """How scans were made, in a sentence: what was assumed, used, and left out."""
        used = f"{self.balance.used:,} of {counted(self.balance.all, 'point')}"
        left = f"; left out: {self.balance.words()}" if self.balance.words() else ""
        timing = "beams by the times of points"
        if self._still:
            all_still = self._still == self._clouds
            timing = "all beams at once" if all_still else f"{timing} but in {self._still}"
            timing += ", for want of times that follow the bearings"
        return f"clouds of {self.topic}: {self._words}, {timing}; {used} used{left}"

    def _choose(self, places: Float, bearings: Float, rings: Int | None) -> None:
        """Choose the ring or the band, and the number of beams, by the first cloud."""
        numbers = np.unique(rings) if rings is not None else np.empty(0, dtype=np.int64)
        elevations = np.arctan2(places[:, 2], np.hypot(*places[:, :2].T))
        usual = [float(np.median(elevations[rings == number])) for number in numbers]
        # The lines of a rosette, and the rings of a tilted lidar, are level only on average.
        steepest = [np.quantile(np.abs(elevations[rings == number]), MOST) for number in numbers]
        # Of two rings that are equally level the upper one does not see the floor.
        ranked = np.lexsort((numbers, -np.sign(usual), np.round(steepest, 3)))
        like = np.ones(len(bearings), dtype=np.bool_)
        if len(ranked):
            best = int(ranked[0])
            like = rings == numbers[best]
            if self.band is None and steepest[best] < LEVEL:
                self._ring = int(numbers[best])
                above = f"{np.degrees(usual[best]):.1f}° above the level"
                self._words = f"ring {self._ring} of {len(numbers)}, {above} (or give --height)"
        order = np.argsort(bearings[like])
        # Without rings, and in lines of a rosette, bearings of several layers lie between each
        # other; neighbours on a ring are of one height, even on a tilted one.
        apart = np.median(np.abs(np.diff(elevations[like][order]))) if len(ranked) else np.inf
        step = step_of(bearings[like][order]) if apart < LEVEL else USUAL_STEP
        if self._ring is None:
            rises = bool(apart >= LEVEL)
            self._words = self._band_words(_height_of_plane(places, bearings), rises=rises)
        self._beams = round(2.0 * np.pi / step)
        self._words += f", {counted(self._beams, 'beam')}"

    def _band_words(self, plane: float, *, rises: bool) -> str:
        """Set the band if none was given; the band in words.

        It is around the height of the lidar, or that of a plane in the frame of the robot itself.
        """
        if self.band is not None:
            frame = self.base or "the lidar, whose mount is unknown"
            return f"points from {self.band[0]:g} to {self.band[1]:g} m above {frame}"
        # If the height of the lidar is known, it counts, whatever the first cloud shows.
        middle = self.height or plane
        self.band = middle - HALF_BAND, middle + HALF_BAND
        self._rises = rises and middle == self.height
        where = "the lidar's height" if middle == self.height else f"their height, {plane:.2g} m"
        widening = f", or up to {np.degrees(RISE):.1f}° above it" if self._rises else ""
        return f"points within {HALF_BAND:g} m of {where}{widening} (or give --height)"

    def _chosen(self, x: Float, y: Float, z: Float, rings: Int | None) -> Bool:
        """Which points (n,) may make a scan, by their places from the lidar and their rings."""
        if self._ring is not None:
            chosen: Bool = rings == self._ring if rings is not None else np.zeros(len(z), np.bool_)
            return chosen
        low, high = self.band or (0.0, 0.0)
        top = np.maximum(high, self.height + RISE * np.hypot(x, y)) if self._rises else high
        return (low <= z + self.height) & (z + self.height <= top)

    def _turning(self, bearings: Float, times: Float | None, stamp: float) -> Turning:
        """How the lidar turned, by the times of its points, if these fit."""
        still = Turning(-np.pi, 1.0, (bearings + np.pi) % (2.0 * np.pi))
        self._clouds += 1
        self._still += 1
        if times is None or not np.isfinite(times).all() or not np.ptp(times):
            return still
        # The largest unit in which the points of a cloud take less than a revolution.
        unit = next((u for u in TIMES.values() if u * np.ptp(times) < LONGEST_SWEEP), 0.0)
        earliest = unit * float(times.min())
        order = np.argsort(times, kind="stable")
        since = unit * (times[order] - times.min())
        turned = np.unwrap(bearings[order])
        rate, first = (float(each) for each in np.polyfit(since, turned, 1))
        apart = turned - (first + rate * since)
        if not unit or np.sqrt(np.mean(apart**2)) > UNEVEN or not rate:
            return still
        self._still -= 1
        begins = next((t for t in (earliest, earliest - stamp) if abs(t) < SAME_CLOCK), 0.0)
        way = float(np.sign(rate))
        positions = np.empty(len(bearings))
        positions[order] = way * (turned - first)
        # Lasers look a little to the left and the right: the first beam is the first of all.
        start = float(wrap_angle(first + way * min(float(positions.min()), 0.0)))
        shift = way * float(wrap_angle(first - start))
        # Angles lie within a turn to both sides of ahead.
        start += float(wrap_angle(start + way * np.pi)) - (start + way * np.pi)
        return Turning(
            start, way, positions + shift, begins - shift / abs(rate), 2.0 * np.pi / abs(rate)
        )


def _height_of_plane(places: Float, bearings: Float) -> float:
    """The height of points (n, 3) above the robot's frame if all are of planar lasers; else 0.

    Points on a floor are low, or many in a bearing.
    """
    looked = len(np.unique(np.round(bearings / USUAL_STEP)))
    height = float(np.median(places[:, 2]))
    is_flat = np.ptp(places[:, 2]) < FLAT < height
    return height if is_flat and ENOUGH <= len(places) <= MOST_FLAT * looked else 0.0


def step_of(bearings: Float) -> float:
    """The usual step [rad] between the ascending bearings (n,) of one ring."""
    gaps = np.diff(bearings)
    # Smaller ones are rounding, or several returns of one pulse.
    gaps = gaps[gaps > FINEST]
    return max(float(np.median(gaps)), FINEST_STEP) if len(gaps) >= ENOUGH else USUAL_STEP


def level_axes(frame: str, mount: Float | None) -> tuple[Float, bool]:
    """A lidar's axes (3, 3) in its level frame, and whether the two frames are the same.

    Without a mount (4, 4), a frame with ``optical`` in its name has z ahead.
    """
    if mount is None:
        optical = "optical" in frame
        return (OPTICAL_AXES if optical else np.eye(3)), True
    yaw = np.arctan2(mount[1, 0], mount[0, 0])
    cos, sin = np.cos(yaw), np.sin(yaw)
    axes = np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]]) @ mount[:3, :3]
    return axes, bool(np.abs(axes - np.eye(3)).max() < ROUNDING)
