"""Fans: the bearings of the beams of messages that do not give them."""

from functools import lru_cache

import numpy as np

from lrf3d.geometry.lines import Float, sealed

# Beams that span more than this [rad] go round.
WHOLE_TURN = 1.9 * np.pi

# Widest fan [rad], a turn and what rounding adds; what is wider has other units.
WIDEST_FAN = 2.1 * np.pi

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
