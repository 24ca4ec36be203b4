"""Resolution: how far apart the beams of a laser are, and what matching its scans allows for.

The angles of the beams enter. A laser with a degree between its beams sees walls as they are in a
single scan. A sparse one, of eleven beams over 180°, meets a wall at points a metre apart: only
many scans together show its walls.
"""

from dataclasses import dataclass

from lrf3d.geometry import Float

SPARSE = 0.04
"""A laser whose beams are farther apart than this [rad] is sparse: two beams meet a wall at a usual
range farther apart than the normals of a single scan reach."""

USUAL_RANGE = 4.0
"""Range [m] at which beams are looked at."""


@dataclass(frozen=True, slots=True)
class Resolution:
    """What matching allows for.

    Args:
        sparse: Whether normals come from many scans together.
        along: How far along a wall a point of it speaks for the wall [m].
        sigma: Standard deviation [m] that a point's distance to its line counts with. The noise of
            a range is about 0.01 m, but points of one wall share the errors of its normal and of
            the map: the denser they are, the more.
        drift: How much faster a robot drifts than with a dense laser.
        submap: Key scans before and after an old one that make the map a loop is closed with.
        overlap: Share of what was seen lately that has to lie on that map.
        around: Key scans that a scan is matched with in the end. With twice as many a dense laser
            takes twice the time, and its mean error moves by a hundredth.
    """

    sparse: bool = False
    along: float = 0.25
    sigma: float = 0.06
    drift: float = 1.0
    submap: int = 5
    overlap: float = 0.6
    around: int = 8

    def submap_of(self, old: int, new: int) -> range:
        """The key scans of the map that a new one is matched with where it meets an old one."""
        return range(max(old - self.submap, 0), min(old + self.submap + 1, new))

    @classmethod
    def of(cls, angles: Float) -> "Resolution":
        """What a laser with beams at these angles (beams,) [rad] takes."""
        step = abs(float(angles[-1] - angles[0])) / max(len(angles) - 1, 1)
        if step <= SPARSE:
            return DENSE
        return cls(
            sparse=True,
            along=max(DENSE.along, USUAL_RANGE * step),
            sigma=0.02,
            drift=2.0,
            submap=10,
            overlap=0.5,
            around=32,
        )


DENSE = Resolution()
"""What the scanners of most robots take."""
