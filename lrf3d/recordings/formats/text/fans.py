"""Fans: the bearings of the beams of messages that do not give them, or of single readings."""

from functools import lru_cache

import numpy as np

from lrf3d.geometry.lines import Bool, Float, Int, sealed

# Beams that span more than this [rad] go round.
WHOLE_TURN = 1.9 * np.pi

# Widest fan [rad], a turn and what rounding adds; what is wider has other units.
WIDEST_FAN = 2.1 * np.pi

# Least share of the steps of bearings that go one way, but for those from scan to scan.
LEAST_ALIKE = 0.9

# Most beams of a fan, in usual readings of a scan, that lacks those without return.
MOST_MISSING = 4.0

# Stamps are not those of scans if there are more of them than turns by this factor, or fewer.
UNLIKE = 1.5

# First and last bearings [degrees] of usual range finders, by the number of their beams.
FANS = {
    180: (-90, 89), 181: (-90, 90), 270: (-135, 134), 271: (-135, 135), 360: (0, 359),
    361: (-90, 90), 541: (-135, 135), 682: (-120, 120), 683: (-120, 120), 721: (-90, 90),
    1080: (-135, 135), 1081: (-135, 135), 1440: (0, 359.75),
}  # fmt: skip


def front_fan(count: int, wide: float = np.pi) -> tuple[float, float]:
    """First angle and step [rad] of beams over a width; those of FLASER are half a turn wide.

    An odd fan reaches both −90° and +90°; an even one leaves +90° out.
    """
    return -0.5 * wide, wide / (count - 1) if count % 2 else wide / count


def front_ends(count: int, wide: float) -> tuple[float, float]:
    """First and last angle [rad] of beams that `front_fan` spreads over a width [rad]."""
    start, step = front_fan(count, wide)
    return start, start + step * (count - 1)


@lru_cache(maxsize=4)
def even_angles(count: int, start: float, step: float) -> Float:
    """Angles (count,) [rad] of a message's beams; successive scans share the array."""
    return sealed(np.asarray(start + step * np.arange(count), dtype=np.float64))


def beams_of(bearings: Float, begins: Int) -> int:
    """Number of beams over all bearings of scans that begin here and may lack some readings."""
    usual = np.median(np.diff(begins))
    # A scan may have no reading.
    jumps = begins[(begins > 0) & (begins < len(bearings))] - 1
    steps = np.delete(np.abs(np.diff(bearings)), jumps)
    if not steps.any():
        return round(float(usual))
    # Few readings have none next to them.
    step = np.median(steps[steps > 0.0])
    wide = np.ptp(bearings)
    beams = 2.0 * np.pi / step if wide > WHOLE_TURN else wide / step + 1.0
    return round(float(np.clip(beams, usual, MOST_MISSING * usual)))


def are_turns(steps: Float, again: Bool, changed: Bool) -> bool:
    """Whether scans begin where bearings start again, and stamps are not those of scans.

    Clocks of whole seconds change after several turns, and those of packets within a turn, where
    the bearings go on as before.
    """
    turns = again.sum()
    # Several returns may have one bearing.
    within = ~again & (steps != 0.0)
    onward = np.sign(steps) == np.sign(steps[within].sum())
    if onward[within].sum() < LEAST_ALIKE * max(within.sum(), 1):
        return False
    is_rarer = turns > UNLIKE * changed.sum()
    is_within = changed.sum() > UNLIKE * max(turns, 1) and 2 * onward[changed].sum() > changed.sum()
    return bool(is_rarer or is_within)


def in_one_piece(bearings: Float) -> Float:
    """Bearings [rad] of a fan through 360°, as 270° to 360° and 0° to 90°, as −90° to 90°."""
    around = np.sort(bearings % (2.0 * np.pi))
    gaps = np.diff(around, append=around[0] + 2.0 * np.pi)
    narrow = 2.0 * np.pi - float(gaps.max())
    if np.ptp(bearings) <= WHOLE_TURN or narrow > WHOLE_TURN:
        return bearings
    # The middle of what the laser does not see.
    behind = around[gaps.argmax()] + 0.5 * gaps.max()
    return np.asarray((bearings - behind) % (2.0 * np.pi) + behind - 2.0 * np.pi)
