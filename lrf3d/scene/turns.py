"""Turns: the paths of beams by mirrors, as they are drawn.

The straight paths of beams enter, as long as their ranges; what leaves are their legs from mirror
to mirror, which the straight way unfolds.
"""

from typing import NamedTuple

import numpy as np

from lrf3d.geometry import Bool, Float, Int, directions
from lrf3d.world import World

MOST_LEGS = 9
"""Legs of a beam: casters turn it up to eight times."""

LEAST_LEG = 1e-9
"""Shortest leg, as a share of the rest of the path: a beam does not meet again what it leaves."""


def turning_walls(world: World) -> Bool:
    """Which walls (n,) turn beams; glass turns little of the light, and lets the rest pass."""
    if not world.materials:
        return np.zeros(len(world.segments), dtype=bool)
    turning = [bool(one and one.mirrors and not one.passes) for one in world.materials]
    return np.array(turning)[world.objects]


class Turns(NamedTuple):
    """The paths of beams."""

    first: Float
    """(beams, 2) where the first leg of each ends [m]."""
    starts: Float
    last: Float
    """(beams, 2) where the last leg of each begins and ends [m]."""
    legs: Float
    """(l, 4) the legs after the first [m]."""
    beams: Int
    """(l,) the beam of each of these."""

    @classmethod
    def of(cls, origin: Float, ends: Float, mirrors: Float) -> "Turns":
        """The ways from an origin (2,) to ends (beams, 2), turned at mirrors (m, 4) [m]."""
        starts, last = np.tile(origin, (len(ends), 1)), ends.copy()
        first, legs, beams = ends.copy(), [np.empty((0, 4))], [np.empty(0, np.int64)]
        going = np.arange(len(ends) if len(mirrors) else 0)
        for turn in range(MOST_LEGS):
            if not len(going):
                break
            share, mirror = _first_crossing(starts[going], last[going], mirrors)
            place = starts[going] + share[:, None] * (last[going] - starts[going])
            if turn:
                legs.append(np.hstack([starts[going], place]))
                beams.append(going)
            else:
                first = place
            turned = (mirror >= 0) & (turn + 1 < MOST_LEGS)
            going, place, mirror = going[turned], place[turned], mirror[turned]
            unit = directions(mirrors[mirror])
            normal = np.column_stack([-unit[:, 1], unit[:, 0]])
            depth = np.einsum("ij,ij->i", last[going] - place, normal)
            last[going] -= 2.0 * depth[:, None] * normal
            starts[going] = place
        return cls(first, starts, last, np.concatenate(legs), np.concatenate(beams))


def _first_crossing(starts: Float, ends: Float, mirrors: Float) -> tuple[Float, Int]:
    """Which share (n,) of the ways from starts to ends (n, 2) leads to which mirror.

    The share is 1 and the mirror −1 where a path meets none.
    """
    way = ends - starts
    offset = mirrors[None, :, :2] - starts[:, None]
    along = mirrors[:, 2:] - mirrors[:, :2]
    with np.errstate(divide="ignore", invalid="ignore"):
        crossing = way[:, 0, None] * along[:, 1] - way[:, 1, None] * along[:, 0]
        share = (offset[..., 0] * along[:, 1] - offset[..., 1] * along[:, 0]) / crossing
        place = (offset[..., 0] * way[:, 1, None] - offset[..., 1] * way[:, 0, None]) / crossing
    meets = (share > LEAST_LEG) & (share < 1.0) & (place >= 0.0) & (place <= 1.0)
    share = np.where(meets, share, np.inf)
    nearest = np.argmin(share, axis=1)
    best = share[np.arange(len(share)), nearest]
    return np.minimum(best, 1.0), np.where(best < 1.0, nearest, -1)
