"""Checks of a drive: whether its scans agree with each other at their poses.

Key scans of a solved drive enter; the share of points that beams of other scans pass through
leaves, for the whole drive and for its worst part. Poses that are wrong by more than a door's width
make rooms overlap. For recorded poses, `doubtful_mount` reports a laser that is mounted otherwise
than declared, and `doubtful_poses` poses that cannot be those of its scans.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.spatial import cKDTree

from lrf3d.base.interrupts import check
from lrf3d.geometry.lines import Bool, Float
from lrf3d.geometry.pose import Pose, between, compose
from lrf3d.laser import LaserScan
from lrf3d.laser.range_finder import beam_directions
from lrf3d.matching.key_scans import (
    MOST_THROUGH,
    MOST_THROUGH_PART,
    Key,
    most_through,
    seen_through_both,
)
from lrf3d.recordings.repair.pairs import WIDEST, is_clear
from lrf3d.slam.motion import size_of

# Largest distance [m] between key scans that are compared: most of what they see is the same.
COMPARED_WITHIN = 3.0

# Least path length [m] between key scans that are compared: adjacent ones agree in any case.
LATER = 20.0

# The same where no place was seen again that late, as a multiple of the distance within which the
# laser sees most walls: a robot in a pen of 3 m comes by again after a few metres.
LATER_SIGHTS = 5.0

# Largest number of pairs of scans that are compared.
PAIRS = 60

# Smallest number of pairs that show whether poses are right.
PAIRS_TO_JUDGE = 5


# Largest distance [m] between scans that must show the same walls: in a log with a scan every metre
# and a half, two scans share so little that even right poses seem wrong.
MOST_APART = 1.2

# Distance [m] that no robot moves between two scans: poses that do are in other units.
UNLIKELY = 30.0

# Distance [m] between scans from which no mount explains their poses.
CONTRADICTED = 0.5


class SelfCheck(NamedTuple):
    """How well the scans of a solved drive agree with each other.

    Attributes:
        violation: Share of the points seen by one scan that beams of another pass through.
        worst_violation: The same in the worst part of the drive; 0 if too few key scans for a part
            could be compared.
        worst_scans: Numbers of the first and the last scan of that part.
        key_scans_compared: Number of key scans that could be compared with earlier ones.
        mixed_pixels: Share of points that beams pass through in adjacent scans.
        later: Least path length [m] between key scans that were compared.

    Examples:
        >>> from lrf3d.slam.checks import SelfCheck
        >>> check = SelfCheck(violation=0.06, key_scans_compared=500, mixed_pixels=0.005)
        >>> check.passed, check.sentences()[0].split(':')[0]
        (False, 'the map contradicts itself')
    """

    violation: float = 0.0
    worst_violation: float = 0.0
    worst_scans: tuple[int, int] = (0, 0)
    key_scans_compared: int = 0
    mixed_pixels: float = 0.0
    later: float = LATER

    @property
    def passed(self) -> bool:
        """Whether places that were seen again were compared, and nothing contradicts the poses."""
        most = most_through(self.mixed_pixels)
        return (
            self.key_scans_compared > 0
            and self.violation <= most
            and self.worst_violation <= MOST_THROUGH_PART
        )

    @property
    def unjudged(self) -> str:
        """Why the map could not be checked, in a sentence; "" if places were compared."""
        again = f"no place was seen again after {self.later:.0f} m: nothing checks the map"
        return "" if self.key_scans_compared else again

    def sentences(self) -> list[str]:
        """The contradiction in one sentence; an empty list if there is none."""
        if not self.key_scans_compared:
            return []
        first, last = self.worst_scans
        share = f"{_percent(self.violation)} of what scans saw"
        where = f"beams of scans {first} to {last}"
        worst = f"{_percent(self.worst_violation)} of what others saw"
        if self.violation > most_through(self.mixed_pixels):
            return [f"the map contradicts itself: beams pass through {share}; poses are wrong"]
        if not self.passed:
            return [f"{where} pass through {worst}: poses are wrong, or the world has changed"]
        if self.violation <= MOST_THROUGH:
            return []
        mixed = f"{_percent(self.mixed_pixels, 1)} in adjacent scans"
        doubt = f"the map may be wrong: beams pass through {share} ({mixed})"
        return [f"{doubt}; {where} pass through {worst}" if self.worst_violation else doubt]


def _percent(share: float, digits: int = 0) -> str:
    return f"{share:.{digits}%}".replace("%", " %")


def self_check(
    keys: Sequence[Key], poses: Float, driven: Float, mixed_pixels: float = 0.0
) -> SelfCheck:
    """Compare the key scans (k,) of a solved drive, at poses (k, 3), where places are revisited.

    Driven (k,) is the distance travelled up to each of them [m].
    """
    later = LATER
    scans, counts = _compared(keys, poses, driven, later)
    if keys and not counts:
        later = min(LATER, LATER_SIGHTS * float(np.median([key.far for key in keys])))
        scans, counts = _compared(keys, poses, driven, later)
    if not counts:
        return SelfCheck(mixed_pixels=mixed_pixels, later=later)
    part_length = 20  # Key scans in a part of a drive.
    part = min(part_length, len(counts))
    through, seen = sliding_window_view(np.array(counts), part, axis=0).sum(axis=2).T
    shares = through / np.maximum(seen, 1)
    worst = int(shares.argmax())
    all_through, all_seen = np.sum(counts, axis=0).tolist()
    return SelfCheck(
        all_through / max(all_seen, 1),
        float(shares[worst]) if part == part_length else 0.0,
        (scans[worst], scans[worst + part - 1]),
        len(counts),
        mixed_pixels,
        later,
    )


def _compared(
    keys: Sequence[Key], poses: Float, driven: Float, later: float
) -> tuple[list[int], list[tuple[int, int]]]:
    """Scans, by number, that came by again after a distance [m]; their points passed and seen."""
    scans = []
    counts = []
    compared = 4  # Number of earlier key scans that each one is compared with, the nearest.
    for number, key in enumerate(keys):
        apart = np.hypot(*(poses[:number, :2] - poses[number, :2]).T)
        since = driven[number] - driven[:number]
        near = np.flatnonzero((apart < COMPARED_WITHIN) & (since > later))
        near = near[np.argsort(apart[near], kind="stable")][:compared]
        if len(near):
            olds = [keys[k] for k in near.tolist()]
            counts.append(seen_through_both(olds, key, between(poses[near], poses[number])))
            scans.append(key.scan)
    return scans, counts


def doubtful_mount(scans: Sequence[LaserScan], *, mirrored: bool = True) -> str | None:
    """Report in a sentence how the laser seems to be mounted; None if it is as declared."""
    own, _, pairs = _paired(scans)
    if len(pairs) < PAIRS_TO_JUDGE:
        return None
    found = dict[tuple[int, int], float]()

    # A mount is tried as a turn [°] and a sense: 1, or −1 for mirrored scans.
    def best_of(turns: range, *senses: int) -> tuple[int, int]:
        for sense in senses:
            apart = [_distances(own[a], own[b], turns, sense) for a, b in pairs]
            found.update(zip(product(turns, [sense]), np.median(apart, axis=0), strict=True))
        return min(found, key=found.__getitem__)

    coarse = 45  # Angle between the mounts that are tried all around [°].
    fine = 15  # Angle between those that are tried near the best of these [°].
    turn, sense = best_of(range(-180 + coarse, 181, coarse), *(1, -1)[: 1 + mirrored])
    best = turn, sense = best_of(range(turn - coarse + fine, turn + coarse, fine), sense)
    declared = found[0, 1]
    clearly = 1.5  # Factor by which scans must fit better with another mount to report it.
    close = 0.02  # Distance [m] that they must fit better in addition.
    if best == (0, 1) or declared < clearly * found[best] + close:
        return None
    fits = 0.1  # Distance [m] between scans at which a mount is right in any case.
    # With poses of another drive, scans fit hardly better at any mount than if the robot had stood.
    stood = float(np.median(_standing(own, pairs)))
    if found[best] > min(CONTRADICTED, max(fits, 0.5 * stood)):
        return None
    turn = (turn + 179) % 360 - 179
    seems = [f"turned by {turn}°"] * (turn != 0) + ["mirrored"] * (sense < 0)
    return (
        f"the poses contradict the laser's mount: scans fit each other to {found[best]:.2f} m"
        f" instead of {declared:.2f} m if it is {' and '.join(seems)}; check its transform"
    )


def leaps(steps: Float) -> Bool:
    """Which of the steps (k,) [m] from scan to scan no robot drives."""
    # They are over 3 m long, and ten times as long as nearly all.
    return np.asarray(steps > max(3.0, 10.0 * float(np.quantile(steps, 0.95))))


def doubtful_poses(scans: Sequence[LaserScan]) -> str | None:
    """Report in a sentence why the poses cannot be those of the scans; None if they can."""
    own, robots, pairs = _paired(scans)
    if len(own) <= PAIRS_TO_JUDGE:
        return None
    steps = np.hypot(*np.diff(robots[:, :2], axis=0).T)
    if leaps(steps).any():
        at = int(steps.argmax()) + 1
        return f"the poses jump by {steps.max():.3g} m at scan {at}; expected one drive, in metres"
    if not pairs:
        far = max(_distances(own[0], own[k])[0] for k in (len(own) // 4, len(own) // 2, -1))
        moved = f"its scans differ by {far:.2g} m: the robot moved, unlike its poses"
        return f"the poses stay at one place, but {moved}" if far > CONTRADICTED else None
    return _contradiction(own, pairs)


def _contradiction(own: Sequence[LaserScan], pairs: Sequence[tuple[int, int]]) -> str | None:
    """Why the poses of pairs of scans cannot be theirs; None if they can.

    Scans far apart differ by much at right poses, too, but less than if the robot had stood. Along
    a plain wall they fit best if it had, whatever their poses.
    """
    apart = np.concatenate([_distances(own[a], own[b]) for a, b in pairs])
    losses = apart - _standing(own, pairs)
    far = float(np.median(apart))
    is_far = len(pairs) >= PAIRS_TO_JUDGE and far >= CONTRADICTED and losses.mean() > 0.0
    if not (is_far or (apart.mean() > 0.5 * CONTRADICTED and is_clear(losses))):
        return None
    return (
        f"the poses contradict the scans: scans from nearby poses differ by {far:.2g} m, more than"
        " if the robot had stood; are they this robot's, in metres?"
    )


def _paired(scans: Sequence[LaserScan]) -> tuple[list[LaserScan], Float, list[tuple[int, int]]]:
    """Scans of the first laser, the robot's poses (k, 3), and pairs between which it moved.

    If the laser's driver splits a revolution into several messages, only those with the field of
    view of the first are compared.
    """
    field = scans[0].angles[[0, -1]]
    same = 0.1  # Angle between the ends of two fields that are the same [rad].
    own = [
        scan
        for scan in scans
        if scan.laser == scans[0].laser
        and scan.hits.any()
        and np.abs(scan.angles[[0, -1]] - field).max() < same
    ]
    robots = np.array([scan.robot for scan in own]).reshape(-1, 3)
    pairs = list[tuple[int, int]]()
    first = 0
    apart = 0.4  # Least distance between the scans of a pair [m],
    turned = 0.2  # or turn [rad].
    for number in range(1, len(robots)):
        distance, turn = size_of(between(robots[first], robots[number]))
        if distance > apart or turn > turned:
            close = distance < MOST_APART and turn < WIDEST
            if close or distance > UNLIKELY:
                pairs.append((first, number))
            first = number
    return own, robots, pairs[:: max(len(pairs) // PAIRS, 1)]


def _standing(own: Sequence[LaserScan], pairs: Sequence[tuple[int, int]]) -> Float:
    """Distances (p,) [m] between the points of pairs of scans, as if the robot had stood."""
    stood = ((own[a], replace(own[b], pose=own[a].pose)) for a, b in pairs)
    return np.concatenate([_distances(*pair) for pair in stood])


def _distances(
    before: LaserScan, after: LaserScan, turns: Sequence[int] = (0,), sense: int = 1
) -> Float:
    """Distances (t,) [m] between the points of two scans by mounts turned by some degrees (t,)."""
    check()
    here = cKDTree(_points(before, sense))
    there = _points(after, sense)
    mounts = np.array(before.mount) + [[0.0, 0.0, np.radians(turn)] for turn in turns]
    lasers = (compose(np.array(scan.robot), mounts) for scan in (before, after))
    moved = [Pose(*pose).apply(there) for pose in between(*lasers).tolist()]
    share = 0.8  # Quantile of the distances: walls along the drive fit at wrong poses, too.
    return np.asarray(np.quantile(here.query(np.array(moved))[0], share, axis=1))


def _points(scan: LaserScan, sense: int) -> Float:
    """Points (n, 2) of a scan in the frame of its laser."""
    hits = np.flatnonzero(scan.hits & (scan.ranges > 0.0))
    points = 200  # Points of a scan that are compared: they show its shape.
    hits = hits[:: max(len(hits) // points, 1)]
    return scan.ranges[hits, None] * beam_directions(0.0, sense * scan.angles[hits])
