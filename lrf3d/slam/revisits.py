"""Revisits: in places that older key scans already show, no new key scan is needed.

A scan, the anchor before it and the key scans enter. If the robot is certainly where it was before,
an anchor leaves: the scan is attached to the nearest key scan, and the pose graph does not grow. So
the graph grows with space, not with time, as a reduced pose graph (Johannsson et al. 2013).
"""

from dataclasses import dataclass, field

import numpy as np

from lrf3d.geometry.lines import Float, wrap_angle
from lrf3d.geometry.pose import between, compose
from lrf3d.matching.key_scans import Key
from lrf3d.matching.search import Submap
from lrf3d.slam.closures import LEAST_DISTANCE, LoopCloser
from lrf3d.slam.front_end import (
    CERTAIN_SHARE,
    KEY_DISTANCE,
    KEY_TURN,
    LEAST_POINTS,
    LOCAL_KEYS,
    WEAK,
    weakest_direction,
)

# Longest path along the graph [m] over which a relative pose is certain, to `GUESS_ERROR`.
CERTAIN = 10.0

# Largest error of the expected pose [m], [m], [rad], and its standard deviations in matching.
GUESS_ERROR = np.array([0.3, 0.3, 0.06])


@dataclass(frozen=True, slots=True)
class Anchor:
    """A scan that ties the front end's path to the graph: a key scan, or one in a known place.

    It has a pose relative to the key scan with the number ``key`` (itself, if it is one) and a pose
    in the front end's drifting frame; ``driven`` is the distance travelled until then [m]. The
    relative pose has a covariance (3, 3), and the drift of the path length ``drifted`` [m]; both
    are 0 for a key scan.
    """

    scan: int
    key: int
    relative: Float
    front: Float
    driven: float
    drifted: float = 0.0
    covariance: Float = field(default_factory=lambda: np.zeros((3, 3)))


def revisit(closer: LoopCloser, scan: Key, last: Anchor, poses: Float) -> Anchor | None:
    """The anchor of a scan in a known place; None if it is to become a key scan.

    The last anchor is the one before it; poses (k, 3) are those of the key scans.
    """
    guess = compose(compose(poses[last.key], last.relative), between(last.front, scan.pose))
    x, y, turn = (poses - guess).T
    apart = np.hypot(x, y)
    old = closer.driven < closer.distance - LEAST_DISTANCE
    drifted = last.drifted + closer.distance - last.driven
    old &= closer.paths.lengths(last.key, CERTAIN) + drifted < CERTAIN
    here = old & (apart < KEY_DISTANCE) & (np.abs(wrap_angle(turn)) < KEY_TURN)
    # Earlier key scans that make a place known. With one, errors after hours in a town are a fifth
    # larger, and covariances too small; in recorded offices nothing changes.
    enough = 2
    if here.sum() < enough or len(scan.surface) < LEAST_POINTS:
        return None
    near = np.argsort(np.where(old, apart, np.inf), kind="stable")[: min(LOCAL_KEYS, old.sum())]
    around = Submap([closer.keys[k] for k in near.tolist()], poses[near])
    match = around.match(scan, guess, np.diag(1.0 / GUESS_ERROR**2))
    if (
        match is None
        or match.explained < CERTAIN_SHARE
        or not (np.abs(between(guess, match.pose)) < GUESS_ERROR).all()
        or closer.mixed_pixels.contradict(around.keys, scan, between(around.poses, match.pose))
    ):
        return None
    # Along a corridor the walls do not fix the distance: there the drift continues.
    fixed = weakest_direction(match.information)[1] >= WEAK
    nearest = int(np.where(here, apart, np.inf).argmin())
    return Anchor(
        scan.scan,
        nearest,
        between(poses[nearest], match.pose),
        scan.pose,
        closer.distance,
        KEY_DISTANCE if fixed else drifted,
        np.diag(GUESS_ERROR**2),
    )
