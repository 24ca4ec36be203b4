"""Units of the numbers in recordings, as factors to those of lrf3d: s, m and rad."""

import numpy as np

# The prefixes of units.
MILLI = 1e-3
MICRO = 1e-6
NANO = 1e-9

# Units by what they measure; the first one is that of lrf3d.
TIMES = {"s": 1.0, "ms": MILLI, "us": MICRO, "ns": NANO}
LENGTHS = {"m": 1.0, "cm": 1e-2, "mm": MILLI}
ANGLES = {"rad": 1.0, "deg": np.pi / 180}
COUNTS = {"": 1.0}
