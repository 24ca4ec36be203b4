"""Units of the numbers in recordings, as factors to those of lrf3d: s, m and rad."""

import numpy as np

# A millimetre [m], a millisecond [s].
MILLI = 1e-3

# A microsecond [s].
MICRO = 1e-6

# A nanosecond [s].
NANO = 1e-9

# Units of times; the first one of each kind is that of lrf3d.
TIMES = {"s": 1.0, "ms": MILLI, "us": MICRO, "ns": NANO, "days": 86400.0}

# Units of lengths.
LENGTHS = {
    "m": 1.0,
    "cm": 1e-2,
    "mm": MILLI,
    "ft": 0.3048,
    "feet": 0.3048,
    "inch": 0.0254,
    "inches": 0.0254,
}

# Units of angles.
ANGLES = {"rad": 1.0, "deg": np.pi / 180}

# Numbers have no unit.
COUNTS = {"": 1.0}
