"""Are ranges by reflectance those of data sheets, and is glass found, and at what cost?

The threshold of a simulated range finder is set so that a wall that reflects 10 % is measured up to
the range that a data sheet states for it. How far walls of other reflectances are measured then is
compared with the sheet. A share of the walls of the city is then made of glass: its map is compared
with the glass that was seen, and the time of casting with that of the same walls without materials.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Annotated

import numpy as np

from benchmarks.glass import found_glass, with_glass
from benchmarks.report import Report
from benchmarks.score import random_poses
from benchmarks.timing import take_turns
from lrf3d.casting import EmbreeCaster, PlanarCaster
from lrf3d.laser import LaserRangeFinder
from lrf3d.world import Material, World, load_world

SHEETS = {
    "Livox Mid-40, Horizon (100 klx)": {0.1: 90.0, 0.2: 130.0, 0.8: 260.0},
    "Ouster OS1 of 2018 (100 klx)": {0.1: 40.0, 0.8: 120.0},
    "Livox Avia (0 klx)": {0.1: 190.0, 0.2: 260.0, 0.8: 450.0},
    "Livox Mid-360 (100 klx)": {0.1: 40.0, 0.8: 70.0},
}
"""Ranges [m] of some range finders by reflectance, as their makers state them: manual of the Livox
Mid series (2019), specifications of Livox Horizon, Avia and Mid-360, data sheet of the OS1."""

STEPS = 40
"""How often the interval is halved in which the farthest wall lies: to less than a millimetre."""

FARTHEST = 2000.0
"""[m] No wall is looked for beyond."""


def returns(reflectance: float, distance: float, lrf: LaserRangeFinder) -> tuple[bool, float]:
    """Whether a wall at a distance [m] and a right angle is measured, and its intensity."""
    wall = Material("wall", diffuse=reflectance)
    world = World([[distance, -1.0, distance, 1.0]], [0], materials=[wall])
    scan = PlanarCaster(world).cast(lrf, (0.0, 0.0, 0.0))
    assert scan.intensities is not None
    return bool(scan.hits[0]), float(scan.intensities[0])


def farthest(reflectance: float, lrf: LaserRangeFinder) -> float:
    """Largest distance [m] at which a wall of a reflectance is measured."""
    near, far = 0.0, FARTHEST
    for _ in range(STEPS):
        middle = 0.5 * (near + far)
        seen = returns(reflectance, middle, lrf)[0]
        near, far = (middle, far) if seen else (near, middle)
    return near


def calibrated(sheet: dict[float, float]) -> LaserRangeFinder:
    """A range finder of one beam whose threshold is that of the first point of a sheet."""
    lrf = LaserRangeFinder(0.0, 0.0, beams=1, range_max=FARTHEST)
    reflectance, distance = next(iter(sheet.items()))
    return replace(lrf, threshold=returns(reflectance, distance, lrf)[1])


def bench(
    *,
    world: Annotated[str, "The world that gets panes."] = "city",
    share: Annotated[float, "Share of its walls that is glass."] = 0.1,
    poses: Annotated[int, "Poses that scans are cast from."] = 200,
    seeds: Annotated[int, "Choices of the panes."] = 1,
    seconds: Annotated[float, "Time for each caster [s]."] = 4.0,
) -> Report:
    """Compare ranges by reflectance with data sheets; map glass, and time casting among it."""
    report = Report(__doc__.splitlines()[0])
    for name, points in SHEETS.items():
        lrf = calibrated(points)
        for reflectance, stated in list(points.items())[1:]:
            found = farthest(reflectance, lrf)
            report.add("data sheets", range_finder=name, reflectance_share=reflectance,
                       sheet=stated, simulated=found, ratio=found / stated)  # fmt: skip
    plan, around = load_world(world), LaserRangeFinder(-np.pi, np.pi, beams=361)
    for seed in range(seeds):
        report.add("glass", **found_glass(plan, seed, around, poses, share))
    cost(report, plan, share, poses, seconds)
    report.notes.append(
        "glass: its length seen [m], how much of that is found, the length marked [m], how much of"
        " that is\nglass, and map segments where a mirror or a pane only shows something."
    )
    return report


def cost(report: Report, world: World, share: float, poses: int, seconds: float) -> None:
    """Time both casters with walls without materials and with some of glass."""
    plain = World(world.segments, world.objects, world.heights)
    lit, _ = with_glass(world, share, np.random.default_rng(1000))
    places, lrf = random_poses(world, poses, np.random.default_rng(0)), LaserRangeFinder()

    def casting(caster: PlanarCaster | EmbreeCaster) -> Callable[[int], object]:
        return lambda _: caster.cast_batch(lrf, places)

    for kind in PlanarCaster, EmbreeCaster:
        calls = {"plain": casting(kind(plain)), "glass": casting(kind(lit))}
        timed = take_turns(calls, seconds=seconds)
        beams = poses * lrf.beams
        report.add(
            "cost of glass",
            caster=kind.__name__,
            plain_s=timed["plain"].low / beams,
            glass_s=timed["glass"].low / beams,
            ratio=timed["glass"].low / timed["plain"].low,
        )
