"""Sights: which scans were seen, so that the very same one again is no news."""

from hashlib import blake2b

import numpy as np

from lrf3d.geometry import Int
from lrf3d.laser import LaserScan

REMEMBERED = 1 << 16
"""How many scans, the latest, are remembered: hours of a drive, in a few megabytes."""


class Sights:
    """The scans seen of late, each as a number of 64 bits."""

    def __init__(self) -> None:
        # A dict keeps its order, so that the oldest is known.
        self._seen: dict[int, None] = {}

    def add(self, scan: LaserScan) -> bool:
        """Remember a scan, and tell whether it is new."""
        digest = blake2b(scan.ranges.tobytes(), digest_size=8)
        digest.update(scan.angles.tobytes())
        digest.update(np.array(scan.pose).tobytes())
        sight = int.from_bytes(digest.digest(), "little", signed=True)
        if sight in self._seen:
            return False
        if len(self._seen) >= REMEMBERED:
            del self._seen[next(iter(self._seen))]
        self._seen[sight] = None
        return True

    def state(self) -> Int:
        """The numbers, the oldest first."""
        return np.fromiter(self._seen, np.int64, len(self._seen))

    def restore(self, state: Int) -> None:
        """Remember just these."""
        self._seen = dict.fromkeys(state.tolist())
