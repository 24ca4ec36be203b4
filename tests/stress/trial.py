"""A trial: batches of beams of one kind through both casters, each beam certified."""

from collections.abc import Callable
from typing import Any

import numpy as np

from lrf3d.casting import EmbreeCaster, PlanarCaster
from lrf3d.geometry import Bool, Float, Int
from lrf3d.world import World
from stress.aims import Batch
from stress.certificate import Certificate, Verdict, certified
from stress.tally import EXAMPLES, Claims, Tally

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


def try_beams(
    make: Callable[[np.random.Generator, int], Batch],
    rng: np.random.Generator,
    beams: int,
    outright: int,
) -> Tally:
    """Try at least so many beams of a kind, at least `outright` of them by rationals anyway."""
    tally = Tally()
    while tally.tried < beams:
        batch = make(rng, min(BATCH, beams - tally.tried))
        shape = len(batch.poses), batch.lrf.beams
        count = shape[0] * shape[1]
        share = (outright - tally.outright) / (beams - tally.tried)
        chosen = rng.permutation(count) < np.ceil(share * count)
        tally += try_batch(batch, chosen.reshape(shape))
    return tally


def try_batch(batch: Batch, outright: Bool) -> Tally:
    """Cast a batch with both casters and compare with the truth."""
    truth = certified(batch.segments, batch.lrf, batch.poses, outright)
    world = World(batch.segments)
    claims = {}
    examples: list[dict[str, Any]] = []
    for name, caster in CASTERS.items():
        ranges, walls = caster(world).scan_batch(batch.lrf, batch.poses)
        verdict = truth.judge(ranges, walls)
        inexact = verdict.errors > allowed(name, verdict)
        claims[name] = Claims(
            int(verdict.wrong.sum()),
            int(inexact.sum()),
            float(verdict.ulps.max(initial=0.0)),
            float(verdict.errors.max(initial=0.0)),
        )
        failed = np.argwhere(verdict.wrong | inexact)[:EXAMPLES].tolist()
        examples += [_example(name, batch, truth, ranges, walls, *at) for at in failed]
    return Tally(
        truth.walls.size,
        int(truth.rational.sum()),
        int(outright.sum()),
        truth.contradictions,
        claims,
        tuple(examples[:EXAMPLES]),
    )


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
