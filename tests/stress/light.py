"""The cases of light: beams through mirrors and glass, up to eight turns, in both casters.

The references share no code with lrf3d. Most beams are certified by bounds on the errors of long
doubles; what these leave open is followed by fractions, which meet every wall with every leg. A
caster must name the walls of a way that is found, and its range may be a unit a leg off. Beams that
meet two walls at one place are left to tests of their own.
"""

from collections.abc import Callable, Iterator
from fractions import Fraction
from functools import partial
from math import ulp
from typing import Any

import numpy as np

from lrf3d.casting.kernels.echoes import MOST_ECHOES
from lrf3d.geometry import Bool, Float, Int
from lrf3d.laser import LaserRangeFinder
from lrf3d.world import World
from stress.cases import EXAMPLES, Case, Findings
from stress.casting import CASTERS
from stress.legs import LEAST, TURNS, WALLS, Ways, follow, shares

BEAMS = 1_000
"""Beams of a fan: enough that following them takes longer than building the scene."""

FAR = 60.0
"""Longest way [m]."""

ULP = 1.0
"""By how many units in the last place a range may be off, for each leg."""

ROUGH = 0.4
"""Ways of which less is known, in units of the last place for each leg, are left to fractions: half
a unit is what rounding takes."""

Scene = tuple[Float, list[str], Float]
"""Walls (n, 4), their materials, and a pose (3,)."""

Pair = tuple[Fraction, Fraction]


class Touching(Exception):
    """Two walls are met at one place."""


def ways(
    walls: list[list[Fraction]], kinds: list[str], origin: Pair, direction: Pair, limit: Fraction
) -> Iterator[tuple[tuple[int, ...], Fraction]]:
    """The walls and lengths of all ways up to a limit on which light may return to the laser."""
    waiting: list[tuple[Pair, Pair, tuple[int, ...], Fraction, int, float]] = [
        (origin, direction, (), Fraction(0), 0, 1.0)
    ]
    while waiting:
        place, turn, chain, way, turns, gain = waiting.pop()
        last = chain[-1] if chain else -1
        met = sorted(
            (t, wall)
            for wall, ends in enumerate(walls)
            if wall != last and (t := _meet(ends, place, turn)) is not None
        )
        if not met or way + met[0][0] > limit:
            continue
        if len(met) > 1 and met[0][0] == met[1][0]:
            raise Touching
        t, wall = met[0]
        place = place[0] + t * turn[0], place[1] + t * turn[1]
        chain, way = (*chain, wall), way + t
        if kinds[wall] != "mirror":
            yield chain, way
        if kinds[wall] == "mirror" and turns < TURNS:
            turned = _mirrored(walls[wall], turn)
            waiting.append((place, turned, chain, way, turns + 1, gain))
        if kinds[wall] == "glass":
            # Ways on which light becomes too weak by far end: among panes there are thousands.
            back, on = gain * _shares(walls[wall], turn) ** 2
            if turns < TURNS and back > 0.5 * LEAST:
                turned = _mirrored(walls[wall], turn)
                waiting.append((place, turned, chain, way, turns + 1, back))
            if len(chain) < WALLS and on > 0.5 * LEAST:
                waiting.append((place, turn, chain, way, turns, on))


def _meet(ends: list[Fraction], place: Pair, turn: Pair) -> Fraction | None:
    """How far along a ray a wall is met."""
    ex, ey = ends[2] - ends[0], ends[3] - ends[1]
    ax, ay = ends[0] - place[0], ends[1] - place[1]
    slope = turn[0] * ey - turn[1] * ex
    if slope == 0:
        if ax * ey == ay * ex:
            raise Touching
        return None
    t, share = (ax * ey - ay * ex) / slope, (ax * turn[1] - ay * turn[0]) / slope
    if not 0 <= share <= 1 or t < 0:
        return None
    if t == 0:
        raise Touching
    return t


def _shares(ends: list[Fraction], turn: Pair) -> Float:
    """Shares (2,) of the light that a pane mirrors and lets pass."""
    along = np.array([[ends[2] - ends[0], ends[3] - ends[1]]], np.longdouble)
    return np.ravel(shares(along, np.array([turn], np.longdouble), np.array([True])))


def _mirrored(ends: list[Fraction], turn: Pair) -> Pair:
    nx, ny = ends[1] - ends[3], ends[2] - ends[0]
    twice = 2 * (turn[0] * nx + turn[1] * ny) / (nx * nx + ny * ny)
    return turn[0] - twice * nx, turn[1] - twice * ny


def try_light(
    make: Callable[[np.random.Generator], Scene],
    rng: np.random.Generator,
    count: int,
    outright: int,
) -> Findings:
    """Try at least ``count`` beams of a kind, at least ``outright`` of them by fractions."""
    found = Findings()
    while found.tried < count:
        done = found.counts.get("outright_by_rationals", 0)
        share = (outright - done) / (count - found.tried)
        found += try_scene(*make(rng), rng.permutation(BEAMS) < np.ceil(share * BEAMS))
    return found


def try_scene(walls: Float, kinds: list[str], pose: Float, outright: Bool) -> Findings:
    """Light a fan of beams with both casters, and compare each way with the truth."""
    world = World(walls, np.arange(len(walls)), materials=kinds)
    lrf = LaserRangeFinder(-np.pi, np.pi, beams=BEAMS, range_max=FAR, echo="last")
    truth = follow(walls, kinds, pose[:2], lrf.directions(pose), FAR)
    legs = (truth.chains >= 0).sum(axis=1)
    too_rough = truth.errors > ROUGH * legs * np.spacing(truth.ways.astype(np.float64))
    left = truth.open | outright
    left[truth.beams[too_rough]] = True
    exact, touching = _by_fractions(walls, kinds, pose, lrf.directions(pose), left)
    counts = {
        "certified_by_bound": int((~left).sum()),
        "certified_by_rationals": int(left.sum()) - int(touching.sum()),
        "outright_by_rationals": int((outright & ~touching).sum()),
    }
    largest: dict[str, float] = {}
    examples: list[dict[str, Any]] = []
    for name, caster in CASTERS.items():
        made = caster(world)
        ranges, chains = made.cast(lrf, pose).ranges, made.chains(lrf, pose)
        errors = _errors(truth, ranges, chains)
        for beam, found in exact.items():
            chain = tuple(chains[beam][chains[beam] >= 0].tolist())
            errors[beam] = _exact_error(found, chain, float(ranges[beam]), kinds)
        errors[touching] = 0.0
        counts[f"{name}.wrong"] = int(np.isinf(errors).sum())
        counts[f"{name}.inexact"] = int((np.isfinite(errors) & (errors > ULP)).sum())
        sound = errors[np.isfinite(errors)]
        largest[f"{name}.largest_error_ulp"] = float(sound.max(initial=0.0))
        metres = errors * np.spacing(np.where(np.isfinite(ranges), ranges, 0.0))
        largest[f"{name}.largest_error_m"] = float(metres[np.isfinite(errors)].max(initial=0.0))
        examples += [
            {"caster": name, "walls": walls.tolist(), "kinds": kinds, "pose": pose.tolist(),
             "beam": beam, "range": repr(float(ranges[beam])), "chain": chains[beam].tolist()}
            for beam in np.flatnonzero(errors > ULP)[:EXAMPLES].tolist()
        ]  # fmt: skip
    failures = sum(count for name, count in counts.items() if "." in name)
    error = largest["planar.largest_error_ulp"]
    # Beams that meet two walls at one place are no trials.
    tried = BEAMS - int(touching.sum())
    return Findings(
        tried, failures, error, tuple(examples[:EXAMPLES]), counts=counts, largest=largest
    )


def _errors(truth: Ways, ranges: Float, chains: Int) -> Float:
    """Errors (b,) of ranges in units of the last place for each leg; ∞ for a wrong way."""
    named = np.full((len(ranges), WALLS), -1)
    named[:, : chains.shape[1]] = chains
    legs = (named >= 0).sum(axis=1)
    errors = np.full(len(ranges), np.inf)
    own = (truth.chains == named[truth.beams]).all(axis=1) & np.isfinite(ranges[truth.beams])
    beams = truth.beams[own]
    off = abs(truth.ways[own] - ranges[beams]).astype(np.float64)
    np.minimum.at(errors, beams, off / np.spacing(ranges[beams]) / legs[beams])
    # The last echo is the farthest, unless there are more of them than a caster keeps.
    farthest, count = np.zeros(len(ranges)), np.bincount(truth.beams, minlength=len(ranges))
    np.maximum.at(farthest, truth.beams[truth.sure], truth.ways[truth.sure].astype(np.float64))
    missed = (farthest > ranges * (1.0 + 1e-12)) & (count <= MOST_ECHOES)
    none = (legs == 0) & (ranges == np.inf) & (farthest == 0.0)
    return np.where(missed & ~none, np.inf, np.where(none, 0.0, errors))


def _by_fractions(
    walls: Float, kinds: list[str], pose: Float, directions: Float, chosen: Bool
) -> tuple[dict[int, list[tuple[tuple[int, ...], Fraction]]], Bool]:
    """All ways of the chosen beams, and which of them (b,) meet two walls at one place."""
    exact = [[Fraction(value) for value in row] for row in walls.tolist()]
    origin = Fraction(float(pose[0])), Fraction(float(pose[1]))
    found, touching = {}, np.zeros(len(directions), np.bool_)
    for beam in np.flatnonzero(chosen).tolist():
        dx, dy = directions[beam].tolist()
        try:
            turn = Fraction(dx), Fraction(dy)
            found[beam] = list(ways(exact, kinds, origin, turn, Fraction(FAR)))
        except Touching:
            touching[beam] = True
    return found, touching


def _exact_error(
    found: list[tuple[tuple[int, ...], Fraction]],
    chain: tuple[int, ...],
    distance: float,
    kinds: list[str],
) -> float:
    """The error of a range in units of the last place for each leg; ∞ for a wrong way."""
    if not chain:
        # All light may be lost on the way through glass, but not among mirrors alone.
        return 0.0 if (not found or "glass" in kinds) and distance == np.inf else np.inf
    # Glass may mirror a beam onto the same wall that it lets it through to.
    off = [abs(Fraction(distance) - way) for known, way in found if known == chain]
    return float(min(off) / Fraction(ulp(distance))) / len(chain) if off else np.inf


def anywhere(rng: np.random.Generator, kinds: list[str], far: float = 0.0) -> Scene:
    """Walls anywhere about the laser, of random materials."""
    count = int(rng.integers(4, 10))
    walls = rng.uniform(-9.0, 9.0, (count, 4)) + far
    pose = np.array([*(far + rng.uniform(-3.0, 3.0, 2)), rng.uniform(-3.0, 3.0)])
    return walls, rng.choice(kinds, count).tolist(), pose


def on_a_grid(rng: np.random.Generator) -> Scene:
    """Walls between whole metres, whose ends beams meet after their turns."""
    walls = rng.integers(-5, 6, (8, 4)).astype(np.float64)
    walls = walls[(walls[:, :2] != walls[:, 2:]).any(axis=1)]
    pose = np.array([*(rng.integers(-4, 5, 2) + 0.5), np.pi / 4 * rng.integers(-4, 5)])
    return walls, rng.choice(["mirror", "mirror", "brick"], len(walls)).tolist(), pose


def gallery(rng: np.random.Generator) -> Scene:
    """Two mirrors side by side, all but parallel, with walls at the ends."""
    width, tilt = rng.uniform(0.5, 4.0), rng.uniform(-1e-3, 1e-3)
    walls = np.array(
        [
            [-8.0, 0.0, 8.0, 0.0],
            [-8.0, width, 8.0, width + tilt],
            [-8.0, -1.0, -8.0, 5.0],
            [8.0, -1.0, 8.0, 5.0],
        ]
    )
    pose = np.array([rng.uniform(-7.0, 7.0), rng.uniform(0.1, 0.9) * width, rng.uniform(-3, 3)])
    return walls, ["mirror", "mirror", "plaster", "brick"], pose


MIRRORS, PANES = ["mirror", "mirror", "brick"], ["mirror", "glass", "glass", "brick"]

LIGHT = tuple(
    Case("light", name, partial(try_light, make), bound=ULP, unit="ulp")
    for name, make in (
        ("mirrors anywhere", partial(anywhere, kinds=MIRRORS)),
        ("mirrors, 1e6 m away", partial(anywhere, kinds=MIRRORS, far=1e6)),
        ("mirrors between whole metres", on_a_grid),
        ("two mirrors all but parallel", gallery),
        ("mirrors and glass", partial(anywhere, kinds=PANES)),
    )
)
"""The cases of light."""
