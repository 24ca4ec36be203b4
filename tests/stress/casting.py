"""The cases of the casters: PlanarCaster and EmbreeCaster on the same beams, each certified."""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from lrf3d.casting import EmbreeCaster, PlanarCaster
from lrf3d.geometry import Bool, Float, Int
from lrf3d.world import World
from stress import beams, worlds
from stress.aims import Batch
from stress.cases import EXAMPLES, Case, Findings
from stress.certificate import Certificate, Verdict, certified

CASTERS: dict[str, Callable[[World], PlanarCaster | EmbreeCaster]] = {
    "planar": PlanarCaster,
    "embree": EmbreeCaster,
}

PLANAR_ULP = 2.0
"""By how many units in the last place a range of PlanarCaster may be off."""

EMBREE_METRES = 1e-9
"""By how much a range of EmbreeCaster may be off [m]; by PLANAR_ULP where a unit is more."""

BATCH = 5000
"""Beams in a world: enough that casting takes longer than building the scene."""

Maker = Callable[[np.random.Generator, int], Batch]


def try_beams(make: Maker, rng: np.random.Generator, count: int, outright: int) -> Findings:
    """Try at least ``count`` beams of a kind, at least ``outright`` of them by rationals."""
    found = Findings()
    while found.tried < count:
        batch = make(rng, min(BATCH, count - found.tried))
        shape = len(batch.poses), batch.lrf.beams
        size = shape[0] * shape[1]
        done = found.counts.get("outright_by_rationals", 0)
        share = (outright - done) / (count - found.tried)
        chosen = rng.permutation(size) < np.ceil(share * size)
        found += try_batch(batch, chosen.reshape(shape))
    return found


def try_batch(batch: Batch, outright: Bool) -> Findings:
    """Cast a batch with both casters and compare with the truth."""
    truth = certified(batch.segments, batch.lrf, batch.poses, outright)
    world = World(batch.segments)
    rational = int(truth.rational.sum())
    counts = {
        "certified_by_bound": truth.walls.size - rational,
        "certified_by_rationals": rational,
        "outright_by_rationals": int(outright.sum()),
        "contradictions": truth.contradictions,
    }
    largest: dict[str, float] = {}
    examples: list[dict[str, Any]] = []
    for name, caster in CASTERS.items():
        ranges, walls = caster(world).scan_batch(batch.lrf, batch.poses)
        verdict = truth.judge(ranges, walls)
        inexact = verdict.errors > allowed(name, verdict)
        counts[f"{name}.wrong"] = int(verdict.wrong.sum())
        counts[f"{name}.inexact"] = int(inexact.sum())
        largest[f"{name}.largest_error_ulp"] = float(verdict.ulps.max(initial=0.0))
        largest[f"{name}.largest_error_m"] = float(verdict.errors.max(initial=0.0))
        failed = np.argwhere(verdict.wrong | inexact)[:EXAMPLES].tolist()
        examples += [_example(name, batch, truth, ranges, walls, *at) for at in failed]
    # What must be 0: wrong decisions, numbers off by too much, and broken proofs.
    failures = sum(
        count for name, count in counts.items() if "." in name or name == "contradictions"
    )
    error = largest["planar.largest_error_ulp"]
    kept = tuple(examples[:EXAMPLES])
    return Findings(truth.walls.size, failures, error, kept, counts=counts, largest=largest)


def allowed(caster: str, verdict: Verdict) -> Float:
    """By how much each range of a caster may be off [m]."""
    few = PLANAR_ULP * verdict.units
    return few if caster == "planar" else np.maximum(EMBREE_METRES, few)


def _example(
    caster: str, batch: Batch, truth: Certificate, ranges: Float, walls: Int, pose: int, beam: int
) -> dict[str, Any]:
    """A failure in JSON's types; its floats are written so that they read back bit for bit."""
    lrf = batch.lrf
    return {
        "caster": caster,
        "segments": batch.segments.tolist(),
        "laser": {
            "angle_min": float(lrf.angle_min),
            "angle_max": float(lrf.angle_max),
            "beams": lrf.beams,
            "range_min": float(lrf.range_min),
            "range_max": float(lrf.range_max),
        },
        "pose": batch.poses[pose].tolist(),
        "beam": beam,
        "claimed": {"range": repr(float(ranges[pose, beam])), "wall": int(walls[pose, beam])},
        "true": {
            "range": repr(float(truth.ranges[pose, beam])),
            "wall": int(truth.walls[pose, beam]),
        },
    }


_KINDS: dict[str, Maker] = {
    "offset 0 m": beams.mixture,
    **{
        f"offset {offset} m": partial(beams.mixture, offset=float(offset))
        for offset in ("1e3", "1e5", "1e6", "1e7")
    },
    **{
        f"scale {scale}": partial(beams.mixture, scale=float(scale))
        for scale in ("1e-3", "1", "1e3", "1e6")
    },
    "at corners to the last bit": beams.at_corners,
    **{
        f"{low} to {high} rad from corners": partial(
            beams.by_corners, low=float(low), high=float(high)
        )
        for low, high in (("1e-15", "1e-12"), ("1e-12", "1e-9"), ("1e-9", "1e-6"), ("1e-6", "1e-3"))
    },
    "grazing": beams.grazing,
    "along walls": beams.along_walls,
    "slivers of 1e-9 m": beams.at_slivers,
    "walls of one ulp and more": beams.at_short_walls,
    "crossing walls": beams.at_crossings,
    "doubled walls, alike": partial(beams.at_doubles, make=worlds.alike),
    "doubled walls, turned round": partial(beams.at_doubles, make=worlds.turned_round),
    "doubled walls, in part": partial(beams.at_doubles, make=worlds.partly_doubled),
    "doubled walls, a hair apart": partial(beams.at_doubles, make=worlds.a_hair_apart),
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
