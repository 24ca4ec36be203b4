"""Units of the numbers in files of others, as factors to those of lrf3d: s, m and rad."""

import math

# A millimetre [m], a millisecond [s].
MILLI = 1e-3

# A microsecond [s].
MICRO = 1e-6

# A nanosecond [s].
NANO = 1e-9

# Units of lengths other than metres, by their size [m].
METRES = {"mm": MILLI, "cm": 0.01, "in": 0.0254, "ft": 0.3048, "km": 1000.0}
INCH = METRES["in"]
FOOT = METRES["ft"]

# Units of times; the first one of each kind is that of lrf3d.
TIMES = {"s": 1.0, "ms": MILLI, "us": MICRO, "ns": NANO, "days": 86400.0}

# Units of the lengths in recordings.
LENGTHS = {
    "m": 1.0,
    "cm": METRES["cm"],
    "mm": MILLI,
    "ft": FOOT,
    "feet": FOOT,
    "inch": INCH,
    "inches": INCH,
}

# Units of angles.
ANGLES = {"rad": 1.0, "deg": math.pi / 180}

# Numbers have no unit.
COUNTS = {"": 1.0}
