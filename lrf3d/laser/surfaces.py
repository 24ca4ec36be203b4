"""What a true scan tells of the surfaces that its beams meet.

A wall is straight, so the points of two neighbouring beams on it tell its line exactly.
"""

import numpy as np

from lrf3d.geometry import Bool, Float
from lrf3d.laser.scan import LaserScan


def on_one_wall(scan: LaserScan) -> Bool:
    """Which beams (beams − 1,) met the same wall as the next one."""
    known = scan.walls >= 0
    return np.asarray(known[:-1] & known[1:] & (scan.walls[:-1] == scan.walls[1:]))


def incidences(scan: LaserScan) -> Float:
    """Angles (beams,) [rad] from each beam to the normal of what it met: 0 straight, π/2 grazing.

    A beam that is alone on its wall tells nothing of how it met it, and counts as straight.
    """
    joined = on_one_wall(scan)
    angles = np.zeros(len(scan.ranges))
    pair = np.flatnonzero(joined)
    near, far = scan.ranges[pair], scan.ranges[pair + 1]
    turn = np.abs(scan.angles[pair + 1] - scan.angles[pair])
    # From one point to the other: so much along the first beam, and so much across it.
    along, across = far * np.cos(turn) - near, far * np.sin(turn)
    first = np.arctan2(np.abs(along), np.abs(across))
    along, across = near * np.cos(turn) - far, near * np.sin(turn)
    second = np.arctan2(np.abs(along), np.abs(across))
    angles[pair + 1] = second
    angles[pair] = first
    return angles


def ranges_between(scan: LaserScan, angles: Float) -> Float:
    """Ranges (n,) [m] that beams at other angles (n,) of the fan would have had.

    Between two beams on one wall it is the exact range to this wall; where the two met different
    things, that of the nearer beam; beyond the fan, that of its last beam. The angles of the scan
    rise.
    """
    after = np.clip(np.searchsorted(scan.angles, angles), 1, len(scan.angles) - 1)
    before = after - 1
    turn = scan.angles[after] - scan.angles[before]
    ahead = np.clip(angles - scan.angles[before], 0.0, turn)
    nearest = np.where(2.0 * ahead > turn, after, before)
    ranges = scan.ranges[nearest]
    # At the beams themselves nothing is to be worked out, and nothing is to be rounded.
    inside = on_one_wall(scan)[before] & (ahead > 0.0) & (ahead < turn)
    near, far = scan.ranges[before[inside]], scan.ranges[after[inside]]
    turn, ahead = turn[inside], ahead[inside]
    ranges[inside] = near * far * np.sin(turn) / (near * np.sin(ahead) + far * np.sin(turn - ahead))
    return ranges
