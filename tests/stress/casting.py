"""The cases of the casters: PlanarCaster and EmbreeCaster on the same beams, each certified."""

from collections.abc import Callable
from functools import partial

import numpy as np

from stress import beams, worlds
from stress.aims import Batch
from stress.tally import Case
from stress.trial import PLANAR_ULP, try_beams

Maker = Callable[[np.random.Generator, int], Batch]


def _mixture(*, scale: float = 1.0, offset: float = 0.0) -> Maker:
    return partial(beams.mixture, scale=scale, offset=offset)


def _by_corners(low: float, high: float) -> Maker:
    return partial(beams.by_corners, low=low, high=high)


def _at_doubles(make: worlds.WorldMaker) -> Maker:
    return partial(beams.at_doubles, make=make)


_KINDS: dict[str, Maker] = {
    "offset 0 m": _mixture(),
    "offset 1e3 m": _mixture(offset=1e3),
    "offset 1e5 m": _mixture(offset=1e5),
    "offset 1e6 m": _mixture(offset=1e6),
    "offset 1e7 m": _mixture(offset=1e7),
    "scale 1e-3": _mixture(scale=1e-3),
    "scale 1": _mixture(),
    "scale 1e3": _mixture(scale=1e3),
    "scale 1e6": _mixture(scale=1e6),
    "at corners to the last bit": beams.at_corners,
    "1e-15 to 1e-12 rad from corners": _by_corners(1e-15, 1e-12),
    "1e-12 to 1e-9 rad from corners": _by_corners(1e-12, 1e-9),
    "1e-9 to 1e-6 rad from corners": _by_corners(1e-9, 1e-6),
    "1e-6 to 1e-3 rad from corners": _by_corners(1e-6, 1e-3),
    "grazing": beams.grazing,
    "along walls": beams.along_walls,
    "slivers of 1e-9 m": beams.at_slivers,
    "walls of one ulp and more": beams.at_short_walls,
    "walls of 5e-324 to 1e7 m": beams.of_all_sizes,
    "crossing walls": beams.at_crossings,
    "doubled walls, alike": _at_doubles(worlds.alike),
    "doubled walls, turned round": _at_doubles(worlds.turned_round),
    "doubled walls, in part": _at_doubles(worlds.partly_doubled),
    "doubled walls, a hair apart": _at_doubles(worlds.a_hair_apart),
    "poses on walls": beams.from_walls,
    "poses on corners": beams.from_corners,
    "limits on the range itself": beams.on_limits,
    "posts between beams": beams.by_posts,
    "fans in a city": beams.in_a_city,
}

CASTING = tuple(
    Case("casting", name, partial(try_beams, make), bound=PLANAR_ULP, unit="ulp")
    for name, make in _KINDS.items()
)
"""The cases of the casters."""
