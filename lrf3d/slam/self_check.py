"""Self-check: whether the scans of a solved drive agree where the robot came by again.

Key scans and their final poses enter. Where two of them stand near each other, with a long way
between them, no beam of the one should pass through what the other saw. The share of beams that do
leaves, for the whole drive and for the worst part of it. Poses that are wrong by more than a door's
width put rooms onto each other, and beams through walls.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lrf3d.geometry import Float
from lrf3d.slam.frames import between
from lrf3d.slam.violation import MOST_THROUGH, Key, seen_through_both

NEAR = 3.0
"""Key scans up to this far apart [m] are compared: most of what they see is the same."""

LATER = 20.0
"""Least path length [m] between two key scans that are compared: adjacent ones agree in any
case."""

COMPARED = 4
"""Earlier key scans that each one is compared with at most, the nearest."""

PART = 20
"""Key scans that a part of a drive has."""

MOST_THROUGH_PART = 0.2
"""Share of points that beams may pass through in such a part. A closed door, or a lorry that has
left, is seen by a few scans; and lasers of ten beams see corners where there are none."""


@dataclass(frozen=True, slots=True)
class SelfCheck:
    """How well the scans of a solved drive agree with each other.

    Args:
        violation: Share of the points seen by one scan that beams of another pass through.
        worst_violation: The same in the worst part of the drive; 0 if fewer key scans than a part
            has could be compared.
        worst_scans: Numbers of the first and the last scan of that part.
        compared: How many key scans could be compared with earlier ones.

    Examples:
        >>> from lrf3d.slam.self_check import SelfCheck
        >>> check = SelfCheck(violation=0.06, compared=500)
        >>> check.passed, check.sentences()[0].split(':')[0]
        (False, 'the map contradicts itself')
    """

    violation: float = 0.0
    worst_violation: float = 0.0
    worst_scans: tuple[int, int] = (0, 0)
    compared: int = 0

    @property
    def passed(self) -> bool:
        """Whether nothing contradicts the poses."""
        return self.violation <= MOST_THROUGH and self.worst_violation <= MOST_THROUGH_PART

    def as_dict(self) -> dict[str, Any]:
        """The figures, in JSON's types."""
        return {
            "passed": self.passed,
            "violation": self.violation,
            "worst_violation": self.worst_violation,
            "worst_scans": list(self.worst_scans),
            "key_scans_compared": self.compared,
        }

    def sentences(self) -> list[str]:
        """What is wrong, a sentence each; an empty list where nothing is."""
        if self.violation > MOST_THROUGH:
            share = f"{100.0 * self.violation:.0f} % of what scans saw"
            return [f"the map contradicts itself: beams pass through {share}; poses are wrong"]
        if not self.passed:
            first, last = self.worst_scans
            share = f"{100.0 * self.worst_violation:.0f} % of what others saw"
            return [
                f"beams of scans {first} to {last} pass through {share}: poses are wrong there,"
                " or the world has changed"
            ]
        return []


def self_check(keys: Sequence[Key], poses: Float, driven: Float) -> SelfCheck:
    """Compare the key scans (k,) of a solved drive, at poses (k, 3), where the robot came by again.

    Driven (k,) is how far the robot had driven at each of them [m].
    """
    scans, counts = [], []
    for number, key in enumerate(keys):
        apart = np.hypot(*(poses[:number, :2] - poses[number, :2]).T)
        near = np.flatnonzero((apart < NEAR) & (driven[:number] < driven[number] - LATER))
        near = near[np.argsort(apart[near], kind="stable")][:COMPARED]
        if len(near):
            olds = [keys[k] for k in near.tolist()]
            counts.append(seen_through_both(olds, key, between(poses[near], poses[number])))
            scans.append(key.scan)
    if not counts:
        return SelfCheck()
    sums = np.cumsum(np.vstack([np.zeros((1, 2)), counts]), axis=0)
    part = min(PART, len(counts))
    through, seen = (sums[part:] - sums[:-part]).T
    shares = through / np.maximum(seen, 1.0)
    worst = int(shares.argmax())
    return SelfCheck(
        float(sums[-1, 0] / max(sums[-1, 1], 1.0)),
        float(shares[worst]) if part == PART else 0.0,
        (scans[worst], scans[worst + part - 1]),
        len(counts),
    )
