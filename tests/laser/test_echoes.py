"""Intensities and echoes on their way through noise, runs, files and ROS messages."""

from dataclasses import replace

import numpy as np
import pytest

import lrf3d
from lrf3d import LaserRangeFinder, World
from lrf3d.laser import AngleNoise, Chain, DropOuts, ProportionalNoise

LRF = LaserRangeFinder(-2.0, 2.0, beams=81, range_min=0.4, range_max=20.0, echoes=3)
POSES = np.column_stack([np.linspace(1.0, 4.0, 7), np.full(7, 2.0), np.linspace(0.0, 1.0, 7)])
NAMES = ("intensities", "echoes", "echo_intensities")


def hall():
    """A room with a mirror on the right, and a pane in the middle."""
    walls = [[0, 0, 8, 0], [8, 0, 8, 6], [8, 6, 0, 6], [0, 6, 0, 0], [5, 0.5, 5, 5.5]]
    materials = ["plaster", "mirror", "brick", "plaster", "glass"]
    return World(walls, objects=range(5), materials=materials)


def simulation(noise=None, lrf=LRF):
    return lrf3d.Simulation(hall(), POSES, lrf, noise=noise, rng=3)


def equal(one, other):
    return all(np.array_equal(getattr(one, name), getattr(other, name)) for name in NAMES)


@pytest.mark.parametrize("caster", ["planar", "embree"])
def test_a_run_keeps_what_its_scans_show_of_the_light(caster):
    steps = list(lrf3d.Simulation(hall(), POSES, LRF, caster=caster, rng=3))
    run = lrf3d.simulate(hall(), POSES, LRF, caster=caster, rng=3)
    assert all(equal(step.scan, run.scan(step.index)) for step in steps)
    assert (np.isfinite(run.echoes).sum(axis=2) > 1).any()
    assert equal(run.part(np.array([2, 5])).scan(1), run.scan(5))


def test_files_and_recordings_give_the_light_back(tmp_path):
    noise = ProportionalNoise(0.1)
    run = lrf3d.simulate(hall(), POSES, LRF, noise=noise, rng=3)
    lrf3d.save_run(run, tmp_path / "saved.npz")
    lrf3d.record(simulation(noise), tmp_path / "recorded.npz")
    for name in ("saved", "recorded"):
        assert equal(lrf3d.load_run(tmp_path / f"{name}.npz"), run)


def test_the_echo_that_is_the_range_has_its_noise_and_each_other_one_its_own():
    noise = ProportionalNoise(0.05)
    for step in simulation(noise):
        scan, true = step.scan, step.true_scan
        hits = np.isfinite(scan.ranges)
        assert (scan.echoes[hits] == scan.ranges[hits, None]).any(axis=1).all()
        assert (scan.echoes[:, 1:] >= scan.echoes[:, :-1]).all()
        assert np.array_equal(np.isfinite(scan.echoes), np.isfinite(true.echoes))
        several = np.isfinite(true.echoes[:, 1])
        moved = scan.echoes[several, :2] - true.echoes[several, :2]
        assert (moved != 0.0).all() and (np.abs(moved) < 0.2).all()


def test_lost_echoes_have_no_intensity():
    lost = 0
    for step in simulation(Chain([AngleNoise(0.002), DropOuts(far=0.9)])):
        scan = step.scan
        gone = np.isinf(scan.echoes)
        assert (scan.echo_intensities[gone] == 0.0).all()
        assert (scan.intensities[~np.isfinite(scan.ranges)] == 0.0).all()
        lost += (gone & np.isfinite(step.true_scan.echoes)).sum()
    assert lost > 20


def test_a_noise_that_forgets_the_light_leaves_unknown_intensities_in_the_run():
    def forgetful(scan, rng):
        return lrf3d.LaserScan(scan.pose, scan.angles, scan.ranges, range_max=scan.range_max)

    run = lrf3d.simulate(hall(), POSES, replace(LRF, echoes=1), noise=forgetful, rng=0)
    assert np.isnan(run.intensities).all()
