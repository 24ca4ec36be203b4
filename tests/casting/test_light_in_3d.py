"""Layers of beams among mirrors and glass, beside the planar casters and beside closed forms."""

import math
from dataclasses import replace

import numpy as np
import pytest
from exact_light import shares, surface_of
from lit_worlds import PERFECT, WHITE, world_of

from lrf3d import EmbreeCaster, InputError, LaserRangeFinder, PlanarCaster, World
from lrf3d.laser.range_finder import layer_directions
from lrf3d.world import Material

AHEAD = LaserRangeFinder(0.0, 0.0, beams=1, height=1.0, range_max=200.0)
ROUND = LaserRangeFinder(-np.pi, np.pi, beams=181, echo="last", echoes=3, threshold=1e-6)


def optical_world(rng, count=9, far=0.0):
    walls = rng.uniform(-9.0, 9.0, (count, 4)) + far
    kinds = rng.choice(["mirror", "glass", "glass", "brick", "metal"], count)
    return World(walls, np.arange(count), materials=kinds.tolist())


def test_a_layer_without_elevation_is_the_scan_with_its_light():
    rng = np.random.default_rng(0)
    for _ in range(20):
        world, pose = optical_world(rng), rng.uniform(-3.0, 3.0, 3)
        caster = EmbreeCaster(world)
        found = caster.light_layers(ROUND, pose, [0.2, 0.0, -0.1])
        for exact in (caster, PlanarCaster(world)):
            scan, chains = exact.cast(ROUND, pose), exact.chains(ROUND, pose)
            assert found.ranges[1].tobytes() == scan.ranges.tobytes()
            assert found.intensities[1].tobytes() == scan.intensities.tobytes()
            assert found.echoes[1].tobytes() == scan.echoes.tobytes()
            assert found.echo_intensities[1].tobytes() == scan.echo_intensities.tobytes()
            assert (found.chains[1][:, : chains.shape[1]] == chains).all()
            assert (found.walls[1] == scan.walls).all()


def test_all_but_level_beams_take_the_ways_of_the_planar_casters():
    # Beams that rise by 1e-11 rad are cast in 3D, and stay within 1e-9 m of the level ones.
    rng, beams, other = np.random.default_rng(1), 0, 0
    for _ in range(60):
        world, pose = optical_world(rng), rng.uniform(-3.0, 3.0, 3)
        found = EmbreeCaster(world).light_layers(ROUND, pose, [1e-11])
        scan = PlanarCaster(world).cast(ROUND, pose)
        chains = PlanarCaster(world).chains(ROUND, pose)
        same = (found.chains[0][:, : chains.shape[1]] == chains).all(axis=1)
        beams, other = beams + len(same), other + np.count_nonzero(~same)
        assert found.ranges[0][same] == pytest.approx(scan.ranges[same], rel=1e-12)
        assert found.intensities[0][same] == pytest.approx(scan.intensities[same], rel=1e-9)
        full = (found.echoes[0] < np.inf).sum(axis=1) == (scan.echoes < np.inf).sum(axis=1)
        both = same & full
        assert found.echoes[0][both] == pytest.approx(scan.echoes[both], rel=1e-11)
    assert beams == 60 * 181 and other == 0


def test_beams_go_over_what_is_lower_behind_mirrors_too():
    # The mirror is 4 m away and the wall 5 m behind the laser: 13 m, and 3.9 m up at 0.29 rad.
    walls = [(4, -9, 4, 9, PERFECT), (-5, -9, -5, 9, WHITE), (-7, -9, -7, 9, WHITE)]
    heights = [3.0, 4.0, 9.0]
    caster = EmbreeCaster(world_of(*walls, heights=heights))
    for elevation, chain in [(0.1, [0, 1]), (0.26, [0, 2]), (0.6, [])]:
        found = caster.light_layers(AHEAD, (0, 0, 0), [elevation])
        assert found.chains[0, 0][found.chains[0, 0] >= 0].tolist() == chain
        away = {0: np.inf, 1: 13.0, 2: 15.0}[chain[-1] if chain else 0]
        assert found.ranges[0, 0] == pytest.approx(away / math.cos(elevation), rel=1e-14)


def test_glass_that_is_met_from_above_divides_the_light_after_fresnel():
    walls = [(2, -9, 2, 9, Material("pane", index=1.5)), (5, -9, 5, 9, WHITE)]
    caster = EmbreeCaster(world_of(*walls, heights=[99.0, 99.0]))
    for elevation in (0.2, 0.7, 1.2):
        cos = math.cos(elevation)
        passed = shares(cos, surface_of(Material("pane", index=1.5)))[1]
        found = caster.light_layers(AHEAD, (0, 0, 0), [elevation])
        want = passed**2 * cos / (5.0 / cos) ** 2
        assert found.intensities[0, 0] == pytest.approx(want, rel=1e-12)
        assert found.chains[0, 0, :3].tolist() == [0, 1, -1]


def test_layers_without_elevations_and_worlds_without_materials():
    world = World([[2, -1, 2, 1]])
    with pytest.raises(InputError, match="without materials"):
        EmbreeCaster(world).light_layers(AHEAD, (0, 0, 0))
    lit = EmbreeCaster(replace(world, materials=["brick"]))
    assert lit.light_layers(AHEAD, (0, 0, 0), []).ranges.shape == (0, 1)
    assert lit.light_layers(AHEAD, (0, 0, 0), [0.0]).ranges.tolist() == [[2.0]]


def test_inclined_beams_that_are_exactly_upright_in_plan_meet_what_lies_across():
    # Turned from this heading by this angle, a beam goes along y to the last bit.
    lrf = LaserRangeFinder(1.001, 1.001, 1, height=1.0, range_max=60.0)
    pose, rise = (0.3, -1.0, 0.5697963267948968), 0.15
    assert layer_directions(lrf, pose[2], [rise])[0, 0, 0] == 0.0
    rng = np.random.default_rng(3)
    for _ in range(10):
        beside = rng.uniform(-9.0, 9.0, (30, 4))
        across = [[-2.0, float(rng.uniform(0.0, 9.0)), 2.0, 9.0]]
        # A wall along the beam has no distance in 3D: what stands across at its end is met.
        along = [[0.3, 0.2, 0.3, 0.1]]
        walls = np.vstack([beside, across, along])
        seen = PlanarCaster(World(walls[:-1])).cast(lrf, pose).ranges[0]
        for materials in (None, ["plaster"] * len(walls)):
            world = World(
                walls, np.arange(len(walls)), np.full(len(walls), 99.0), materials=materials
            )
            ranges, _ = EmbreeCaster(world).cast_layers(lrf, pose, [rise])
            assert ranges[0, 0] == pytest.approx(seen / math.cos(rise), rel=1e-12)
