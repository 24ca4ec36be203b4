"""Beams with a width, in scans with intensities: two surfaces at an edge, one echo or two."""

from dataclasses import replace

import numpy as np
import pytest

from lrf3d import LaserRangeFinder, PlanarCaster, World
from lrf3d.laser import MixedPixels, imperfect

LRF = LaserRangeFinder(-0.5, 0.5, beams=51, range_max=30.0, echoes=3)
STEP = 1.0 / 50.0
WIDE = 2.0 * STEP


def scan_of(depth, materials=("plaster", "brick"), lrf=LRF):
    """A wall 3 m ahead that ends to the left, and one behind it."""
    walls = [[3, -9, 3, 0.03], [3 + depth, -9, 3 + depth, 9]]
    return PlanarCaster(World(walls, [0, 1], materials=materials)).cast(lrf, (0, 0, 0))


def mixed(scan, noise, count=300):
    return [noise(scan, np.random.default_rng(seed)) for seed in range(count)]


def edge_of(scan):
    """The last beam on the near wall."""
    return int(np.flatnonzero(np.diff(scan.walls))[0])


def test_far_apart_each_surface_returns_its_share_of_its_light():
    scan = scan_of(4.0)
    own = edge_of(scan)
    for after in mixed(scan, MixedPixels(WIDE)):
        # Both beams have light on the other side, unless the edge is half a width away.
        for beam, other in ((own, own + 1), (own + 1, own)):
            found = after.echoes[beam][np.isfinite(after.echoes[beam])]
            lights = after.echo_intensities[beam][: len(found)]
            known = {scan.ranges[beam], scan.ranges[other]}
            assert set(found.tolist()) <= known and scan.ranges[beam] in found
            shares = {
                away: back / scan.intensities[beam if away == scan.ranges[beam] else other]
                for away, back in zip(found.tolist(), lights.tolist(), strict=True)
            }
            assert sum(shares.values()) == pytest.approx(1.0, rel=1e-12)
            assert shares[scan.ranges[beam]] >= 0.5
        others = np.delete(np.arange(51), [own, own + 1])
        assert (after.echoes[others] == scan.echoes[others]).all()
        assert (after.intensities[others] == scan.intensities[others]).all()
    twice = [np.isfinite(after.echoes[own, 1]) for after in mixed(scan, MixedPixels(WIDE))]
    assert all(twice)


@pytest.mark.parametrize("echo", ["first", "last", "strongest"])
def test_the_range_is_the_echo_that_the_laser_chooses(echo):
    # What is behind shines brighter, however little of the beam falls on it.
    scan = scan_of(4.0, ("dark cloth", "retro-reflector"))
    for several in (scan, replace(scan, echoes=None, echo_intensities=None)):
        for after in mixed(several, MixedPixels(WIDE, echo=echo), 50):
            for beam in (edge_of(scan), edge_of(scan) + 1):
                wall = {"first": 0, "last": 1, "strongest": 1}[echo]
                assert after.walls[beam] == wall
                assert after.ranges[beam] in scan.ranges[scan.walls == wall]
            assert (after.echoes is None) == (several.echoes is None)


def test_within_a_pulse_two_surfaces_are_one_echo_weighted_by_their_light():
    scan = scan_of(0.5, ("dark cloth", "plaster"))
    own = edge_of(scan)
    near, far = scan.ranges[own], scan.ranges[own + 1]
    for after in mixed(scan, MixedPixels(WIDE, pulse=0.75)):
        assert np.isinf(after.echoes[own, 1]) and after.walls[own] == -1
        light, back = scan.intensities[own], scan.intensities[own + 1]
        share = (after.intensities[own] - light) / (back - light)
        assert 0.0 < share <= 0.5
        want = ((1 - share) * light * near + share * back * far) / after.intensities[own]
        assert after.ranges[own] == pytest.approx(want, rel=1e-12)
        assert after.echoes[own, 0] == after.ranges[own]


def test_echoes_below_the_threshold_are_not_detected():
    scan = scan_of(4.0)
    own = edge_of(scan)
    limit = 0.3 * scan.intensities[own + 1]
    seen = 0
    for after in mixed(scan, MixedPixels(WIDE, threshold=limit)):
        lights = after.echo_intensities[own]
        assert ((lights == 0.0) | (lights >= limit)).all()
        seen += lights[1] > 0.0
    # Its share is above 0.3 where the edge is within 0.4 steps of the beam.
    assert 0.3 < seen / 300 < 0.5
    blind = MixedPixels(WIDE, threshold=9.0)(scan, np.random.default_rng(0))
    assert np.isinf(blind.ranges[own]) and blind.intensities[own] == 0.0 and blind.walls[own] == -1


def test_what_is_behind_glass_stays_an_echo_at_an_edge():
    walls = [[3, -9, 3, 0.03], [5, -9, 5, 9], [9, -9, 9, 9]]
    world = World(walls, range(3), materials=["plaster", "glass", "brick"])
    scan = PlanarCaster(world).cast(LRF, (0, 0, 0))
    own = edge_of(scan)
    after = MixedPixels(WIDE)(scan, np.random.default_rng(0))
    assert np.isfinite(after.echoes[own]).sum() == 2
    pane, behind = scan.echoes[own + 1, :2]
    assert {pane, behind} < set(after.echoes[own + 1].tolist())
    assert (np.diff(after.echoes[own + 1]) > 0.0).all()


def test_a_chain_has_the_choice_and_the_threshold_of_the_laser():
    chain = imperfect(0.0, replace(LRF, echo="last", threshold=0.001), beam_deg=0.5)
    assert chain.noises[0] == MixedPixels(np.radians(0.5), echo="last", threshold=0.001)
