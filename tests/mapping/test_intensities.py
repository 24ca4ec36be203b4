"""Intensities that are no light mark nothing as glass or a mirror, and one line says so."""

import warnings
from dataclasses import replace

import numpy as np
import pytest
from map_objects import map_of

import lrf3d
from lrf3d.errors import Lrf3dWarning

SCANS = 60


@pytest.fixture(scope="module")
def scans():
    run = lrf3d.simulate(lrf3d.load_scenario("corridor"), caster="planar", scans=SCANS, rng=0)
    return list(run.scans)


def in_units(scan, unit):
    rng = np.random.default_rng(scan.walls)
    by_wall = 37.0 * (scan.walls + 1) % 256
    intensities = {
        "by wall": by_wall,
        "by wall, noisy": np.abs(by_wall + rng.normal(0.0, 10.0, len(by_wall))),
        "constant": np.full(len(by_wall), 100.0),
        "noise": rng.normal(100.0, 20.0, len(by_wall)),
        "linear": np.maximum(255.0 - 8.0 * scan.ranges, 1.0),
    }[unit]
    return replace(scan, intensities=np.where(scan.hits, intensities, 0.0))


@pytest.mark.parametrize("unit", ["by wall", "by wall, noisy", "constant", "noise", "linear"])
def test_intensities_in_a_device_s_own_units_mark_nothing_and_a_line_says_so(scans, unit):
    with pytest.warns(Lrf3dWarning, match="do not fall with range and incidence") as told:
        found = map_of([in_units(scan, unit) for scan in scans])
    assert len(told) == 1
    assert np.array_equal(found.segments, map_of(scans).segments)
    assert (found.kinds == "wall").all()


@pytest.mark.parametrize("value", [np.nan, np.inf, -1.0, 0.0])
def test_intensities_that_are_no_light_are_left_out_without_a_word(scans, value):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = map_of(
            [replace(scan, intensities=np.full(len(scan.ranges), value)) for scan in scans]
        )
    assert np.array_equal(found.segments, map_of(scans).segments)


def test_scans_of_lit_points_that_are_no_walls_are_kept(scans):
    angles = np.array([0.0, 1.0, 2.0])
    lone = [
        replace(
            one, angles=angles, ranges=np.array([1.0, 3.0, 9.0]), intensities=np.ones(3),
            walls=np.full(3, -1), echoes=None, echo_intensities=None,
        )
        for one in scans[:9]
    ]  # fmt: skip
    assert len(map_of(lone)) == 0
    assert len(map_of([*lone, *scans])) > 0
