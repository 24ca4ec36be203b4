"""Light: the last scans with intensities, if these depend on range and incidence as light does.

Along a diffuse wall the light of a beam falls with the cosine of the incidence and the square of
the range. The numbers that many devices report do not, and show neither glass nor mirrors.
"""

import warnings

import numpy as np

from lrf3d.compiling import record
from lrf3d.errors import Lrf3dWarning
from lrf3d.geometry import Float, Records, cross, directions, lengths
from lrf3d.laser import LaserScan, RangeNoise
from lrf3d.mapping.robust.beams import CELL, Beams

RAY = record(
    ux=float, uy=float,  # the unit vector of the beam
    range=float,  # [m] 0 where nothing returned
    free=float,  # [m] how far it is free at least
    deviation=float,  # [m] the standard deviation of the range
    bright=float,  # the light of the return as if from 1 m, compared with the usual one
    reflectance=float,  # how reflective the wall is that it is on, 0 where it is on none
    first=float,  # [m] how far it goes to the first known glass or mirror
    direct=float,  # 1 if it ended where it went to, and no mirror turned it
)  # fmt: skip
"""A beam of a kept scan."""

MOST_SCANS = 160
"""[scans] Scans kept: at least the last 80 m of a drive. Mirrors found before remain."""


class LitScans:
    """The last kept scans: their places (k, 2) [m], and :data:`RAY` (k, n) by rising angle."""

    def __init__(self) -> None:
        self._places, self._rays = np.zeros((MOST_SCANS, 2)), np.zeros((MOST_SCANS, 0), RAY)
        self._last, self._usual = np.full(3, np.inf), 0.0
        self._fitting = self._pairs = self._count = 0
        self._warned = False

    def rows(self, newest: bool) -> tuple[Float, Records]:
        """Places and rays of all kept scans, or of the newest alone."""
        last = (self._count - 1) % MOST_SCANS
        rows = slice(last, last + 1) if newest else slice(0, self._count)
        return self._places[rows], self._rays[rows]

    def keep(
        self, scan: LaserScan, pose: tuple[float, float, float], noise: RangeNoise, walls: Float
    ) -> bool:
        """Keep a scan with its walls (w, 4) around the laser in place of the oldest.

        Returns whether it was kept and the intensities so far are light. A scan is dropped if it
        has no intensities, or if the robot has hardly moved.
        """
        off = np.abs(np.array(pose) - self._last)
        least_motion = 0.5  # [m, rad] Motion of the robot after which a scan is kept.
        if scan.intensities is None or (max(np.hypot(*off[:2]), off[2]) <= least_motion):
            return False
        lights = scan.intensities[np.argsort(scan.angles, kind="stable")]
        units, free, _ = Beams.of(scan, pose[2], noise)
        ranges = free.clip(0.0)
        light = np.where((lights > 0.0) & (lights < np.inf), lights * ranges * ranges, 0.0)
        if not light.any():
            return False
        # [share] Quantile of the light of the returns of a scan that is its usual light: near a
        # front of glass most are dim.
        usual_share = 0.7
        usual = float(np.log(np.quantile(light[light > 0.0], usual_share)))
        self._usual = (self._count * self._usual + usual) / (self._count + 1)
        more = max(len(light) - self._rays.shape[1], 0)
        self._rays = np.pad(self._rays, ((0, 0), (0, more))) if more else self._rays
        row = self._count % MOST_SCANS
        self._places[row], self._rays[row], self._last = pose[:2], 0, np.array(pose)
        rays = self._rays[row, : len(light)]
        rays["ux"], rays["uy"] = units.T
        rays["range"], rays["free"] = ranges, np.abs(free)
        rays["deviation"] = np.sqrt(noise.variance(ranges))
        rays["bright"] = light / np.exp(self._usual)
        self._read_reflectances(rays, light, walls)
        self._count += 1
        # [share, pairs] Intensities are light if this share of at least this many pairs fits: metal
        # and glass never do.
        least_fitting, least_pairs = 0.5, 100
        are_light = self._fitting >= least_fitting * self._pairs
        if self._pairs >= least_pairs and not are_light and not self._warned:
            self._warned = True
            warnings.warn(
                "intensities do not fall with range and incidence as light does: the map has no"
                " glass and no mirrors", Lrf3dWarning, stacklevel=2,
            )  # fmt: skip
        return self._pairs >= least_pairs and are_light

    def _read_reflectances(self, rays: Records, light: Float, walls: Float) -> None:
        """Fill in the reflectances of the walls (w, 4) that rays (n,) end on, and count pairs."""
        if not len(walls):
            return
        lit = np.flatnonzero(light)
        along, units = directions(walls), np.column_stack([rays["ux"], rays["uy"]])[lit, None]
        off = units * rays["range"][lit, None, None] - walls[:, :2]
        station, cosines = (off * along).sum(axis=2), np.abs(cross(along, units))
        # [cosine] Least incidence: the direction of a wall is not known well enough for smaller
        # ones.
        weakest_cosine = 0.1
        on = (np.abs(cross(along, off)) < CELL) & (cosines > weakest_cosine)
        on &= (station > -CELL) & (station < lengths(walls) + CELL)
        there, wall = on.any(axis=1), on.argmax(axis=1)
        lit, wall, cosine = lit[there], wall[there], cosines[there, wall[there]]
        rays["reflectance"][lit] = reflectance = light[lit] / cosine
        # [share, log] Distance in the scan, and difference by the laser equation, from which on two
        # returns of a wall are compared.
        farther_apart, least_change = 0.05, 0.2
        # Adjacent returns differ too little to be compared.
        apart = int(farther_apart * len(rays)) + 1
        expected, found = np.log(cosine / rays["range"][lit] ** 2), np.log(reflectance)
        change = np.abs(expected[apart:] - expected[:-apart])
        compared = (wall[apart:] == wall[:-apart]) & (change > least_change)
        # [share] Largest relative error of that difference. Light that falls with the range alone
        # has a third.
        largest_misfit = 0.3
        fits = np.abs(found[apart:] - found[:-apart]) < largest_misfit * change
        self._pairs += int(compared.sum())
        self._fitting += int((fits & compared).sum())
