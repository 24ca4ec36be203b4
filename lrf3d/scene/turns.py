"""Turns: the ways of beams by mirrors, as they are drawn.

The straight ways of beams enter, as long as their ranges; what leaves are their legs from mirror to
mirror, which the straight way unfolds.
"""

from typing import NamedTuple

import numpy as np

from lrf3d.geometry import Bool, Float, Int, directions
from lrf3d.world import World

MOST_LEGS = 9
"""Legs of a beam: casters turn it up to eight times."""

LEAST_LEG = 1e-9
"""Shortest leg, as a share of the rest of the way: a beam does not meet again what it leaves."""


class WallOptics(NamedTuple):
    """Which walls do more with beams than end them.

    Args:
        mirrors: (n,) those that turn them.
        clear: (n,) those that let them pass.
    """

    mirrors: Bool
    clear: Bool

    @classmethod
    def of(cls, world: World) -> "WallOptics | None":
        """Those of a world; None where all walls end beams."""
        kinds = [(bool(one and one.mirrors), bool(one and one.passes)) for one in world.materials]
        if not any(mirrors or passes for mirrors, passes in kinds):
            return None
        rows = np.array(kinds)[world.objects]
        # Glass turns little of the light, and lets the rest pass.
        return cls(rows[:, 0] & ~rows[:, 1], rows[:, 1])


class Turns(NamedTuple):
    """The ways of beams.

    Args:
        first: (beams, 2) where the first leg of each ends [m].
        last: (beams, 2) where its last leg ends [m].
        starts: (beams, 2) where its last leg begins [m].
        mirrors: (beams,) the first mirror, −1 for none.
        legs: (l, 4) the legs after the first [m].
        beams: (l,) the beam of each of these.
    """

    first: Float
    last: Float
    starts: Float
    mirrors: Int
    legs: Float
    beams: Int

    @classmethod
    def of(cls, origin: Float, ends: Float, mirrors: Float) -> "Turns":
        """The ways from an origin (2,) to ends (beams, 2), turned at mirrors (m, 4) [m]."""
        count = len(ends)
        starts, ends = np.tile(origin, (count, 1)), ends.copy()
        first, met = ends.copy(), np.full(count, -1)
        legs, beams = [np.empty((0, 4))], [np.empty(0, np.int64)]
        going = np.arange(count)
        for turn in range(MOST_LEGS):
            share, mirror = _first_crossing(starts[going], ends[going], mirrors)
            place = starts[going] + share[:, None] * (ends[going] - starts[going])
            if turn:
                legs.append(np.hstack([starts[going], place]))
                beams.append(going)
            else:
                first, met = place, mirror
            turned = (mirror >= 0) & (turn + 1 < MOST_LEGS)
            going, place, mirror = going[turned], place[turned], mirror[turned]
            if not len(going):
                break
            unit = directions(mirrors[mirror])
            normal = np.column_stack([-unit[:, 1], unit[:, 0]])
            depth = np.einsum("ij,ij->i", ends[going] - place, normal)
            ends[going] -= 2.0 * depth[:, None] * normal
            starts[going] = place
        return cls(first, ends, starts, met, np.concatenate(legs), np.concatenate(beams))


def _first_crossing(starts: Float, ends: Float, mirrors: Float) -> tuple[Float, Int]:
    """Which share (n,) of the ways from starts to ends (n, 2) leads to which mirror.

    The share is 1 and the mirror −1 where a way meets none.
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
