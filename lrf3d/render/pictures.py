"""Pictures: arrays (h, w, 4) uint8 of red, green, blue and opacity, row 0 at the top."""

import numpy as np
from numpy.typing import NDArray

Picture = NDArray[np.uint8]
