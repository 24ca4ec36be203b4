"""Does the laser equation with a threshold give the ranges that data sheets state by reflectance?

``python -m benchmarks.data_sheets [--out FIGURE]``: the threshold of a simulated range finder is
set so that a wall that reflects 10 % is measured up to the range that a data sheet states for it.
How far walls of other reflectances are measured then is compared with what the sheet states.
"""

import argparse
from dataclasses import replace

import numpy as np

from benchmarks.chart import COLOURS
from lrf3d.casting import PlanarCaster
from lrf3d.geometry import Float
from lrf3d.laser import LaserRangeFinder
from lrf3d.sheet import quiet, save_figure, sheet
from lrf3d.world import Material, World

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


def draw(path: str) -> None:
    """Draw the ranges of the sheets over those that are simulated."""
    figure = sheet(7.2, 4.6, "Range by reflectance", "points: data sheets; lines: laser equation")
    panel = quiet(figure.add_subplot())
    shares: Float = np.geomspace(0.05, 1.0, 25)
    for colour, (name, points) in zip(COLOURS, SHEETS.items(), strict=False):
        lrf = calibrated(points)
        panel.plot(shares, [farthest(float(one), lrf) for one in shares], color=colour)
        panel.plot(*zip(*points.items(), strict=True), "o", color=colour, label=name)
    panel.set(xscale="log", yscale="log", xlabel="reflectance", ylabel="largest range [m]")
    panel.set_xticks([0.05, 0.1, 0.2, 0.4, 0.8], ["5 %", "10 %", "20 %", "40 %", "80 %"])
    panel.set_yticks([20, 50, 100, 200, 500], ["20", "50", "100", "200", "500"])
    panel.minorticks_off()
    panel.legend(fontsize=8.5, frameon=False, loc="upper left")
    save_figure(figure, path)


def main() -> None:
    """Print a row for each point of a sheet but the first."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", help="the figure to write")
    given = parser.parse_args()
    print("range finder                      reflectance   sheet [m]   simulated [m]   ratio")
    for name, points in SHEETS.items():
        lrf = calibrated(points)
        for reflectance, stated in list(points.items())[1:]:
            found = farthest(reflectance, lrf)
            print(
                f"{name:33s} {reflectance:11.2f} {stated:11.0f} {found:15.1f} {found / stated:7.2f}"
            )
    if given.out:
        draw(given.out)


if __name__ == "__main__":
    main()
