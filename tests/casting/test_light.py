"""Mirrors, glass and intensities, beside closed forms and beside rationals."""

import math
from dataclasses import replace

import numpy as np
import pytest
from exact_light import ExactLight, brightness, shares, surface_of
from hypothesis import given
from hypothesis import strategies as st
from lit_worlds import PERFECT, WHITE, world_of

import lrf3d
from lrf3d import EmbreeCaster, LaserRangeFinder, PlanarCaster, World
from lrf3d.casting.kernels.light import MOST_TURNS
from lrf3d.world import Material
from stress import NAMES, lit

CASTERS = (PlanarCaster, EmbreeCaster)
both = pytest.mark.parametrize("caster", CASTERS)
ROUND = LaserRangeFinder(-np.pi, np.pi, beams=91)
AHEAD = LaserRangeFinder(0.0, 0.0, beams=1)


@given(st.floats(0.0, 1.0), st.floats(0.0, 1.0), st.floats(1.0, 3.0))
def test_glass_splits_the_light_that_it_does_not_scatter_after_fresnel(cos, diffuse, index):
    pane = surface_of(Material("pane", diffuse=diffuse, index=index))
    rest, face = 1.0 - diffuse, ((index - 1.0) / (index + 1.0)) ** 2
    mirrored, passed = shares(cos, pane)
    assert 0.0 <= mirrored <= 1.0 and -1e-12 <= passed <= 1.0
    assert mirrored + passed == pytest.approx(rest)
    assert shares(1.0, pane)[0] == pytest.approx(rest * 2.0 * face / (1.0 + face))
    assert shares(0.0, pane) == pytest.approx((rest, 0.0))


@given(st.floats(-1.5, 1.5), st.floats(0.0, 0.5), st.floats(0.0, 1.0), st.floats(0.05, 1.0))
def test_a_surface_is_as_bright_as_its_cosine_and_a_gaussian_of_twice_the_angle(
    angle, diffuse, retro, lobe
):
    plain = Material("cloth", diffuse=diffuse, retro=retro, lobe_deg=math.degrees(lobe))
    cos, sin = math.cos(angle), abs(math.sin(angle))
    assert brightness(cos, sin, surface_of(plain), 0.0) == pytest.approx((diffuse + retro) * cos)
    glossy = surface_of(replace(plain, specular=0.5))
    shine = brightness(cos, sin, glossy, 0.5) - (diffuse + retro) * cos
    want = 0.25 / lobe**2 * math.exp(-0.5 * (2.0 * angle / lobe) ** 2)
    assert shine == pytest.approx(want, abs=1e-12)


@both
def test_intensities_are_those_of_the_laser_equation(caster):
    rng = np.random.default_rng(0)
    for _ in range(200):
        distance, angle = rng.uniform(0.5, 60.0), rng.uniform(-1.4, 1.4)
        diffuse, near = rng.uniform(0.01, 1.0), rng.uniform(0.1, 5.0)
        normal, along = np.array([math.cos(angle), math.sin(angle)]), rng.uniform(1.0, 9.0)
        across = along * np.array([-normal[1], normal[0]])
        middle = np.array([distance, 0.0])
        ends = np.concatenate([middle - across, middle + across])
        world = world_of((*ends, Material("wall", diffuse=diffuse)))
        lrf = replace(AHEAD, near_field=near)
        scan = caster(world).cast(lrf, (0, 0, 0))
        catches = (1 - math.exp(-2 * (distance / near) ** 2)) / (1 - math.exp(-2 / near**2))
        want = diffuse * math.cos(angle) / distance**2 * catches
        assert scan.intensities[0] == pytest.approx(want, rel=1e-12)
        assert scan.ranges[0] == pytest.approx(distance, rel=1e-12)


@both
def test_a_dark_wall_returns_nothing_beyond_the_range_of_its_light(caster):
    world = world_of((-90, 2, 90, 2, "dark cloth"))
    lrf = replace(ROUND, threshold=1e-3, beams=721)
    scan = caster(world).cast(lrf, (0, 0, 0))
    sine = np.sin(lrf.angles)
    with np.errstate(divide="ignore"):
        bright = 0.05 * sine / (2.0 / sine) ** 2
    seen = (sine > 0.02) & (bright >= 1e-3)
    assert (np.isfinite(scan.ranges) == seen).all() and 0 < seen.sum() < 300
    assert (scan.walls == np.where(seen, 0, -1)).all()
    assert (scan.intensities[~seen] == 0.0).all()


@both
def test_without_mirrors_and_glass_ranges_are_what_they_are_without_materials(caster):
    world = lrf3d.load_world("city")
    named = replace(world, materials=["brick"] * world.object_count)
    lrf = replace(ROUND, range_min=3.0)
    poses = lrf3d.load_scenario("city").run(rng=0, scans=40).trajectory.poses
    plain, lit = caster(world).scan_batch(lrf, poses), caster(named).scan_batch(lrf, poses)
    assert plain[0].tobytes() == lit[0].tobytes() and (plain[1] == lit[1]).all()
    assert caster(world).cast(lrf, poses[0]).intensities is None


@both
def test_parallel_mirrors_turn_a_beam_up_to_eight_times(caster):
    # Each crossing of the gap takes the beam 1 m on; the last wall stands behind the mirrors.
    pose, mirrors = (-0.5, 1.5, math.atan2(3, 1)), [(-1, y, 50, y, PERFECT) for y in (0, 3)]
    for turns in range(MOST_TURNS + 2):
        end = turns - 0.25
        there = caster(world_of(*mirrors, (end, -1, end, 4, WHITE)))
        scan, chain = there.cast(AHEAD, pose), there.chains(AHEAD, pose)[0].tolist()
        if turns > MOST_TURNS:
            assert np.isinf(scan.ranges[0])
            continue
        assert chain == [*[1, 0, 1, 0, 1, 0, 1, 0][:turns], 2] and scan.walls[0] == 2
        assert scan.ranges[0] == pytest.approx((end + 0.5) * math.sqrt(10.0), rel=1e-14)
        want = 1 / math.sqrt(10) / scan.ranges[0] ** 2
        assert scan.intensities[0] == pytest.approx(want, rel=1e-12)


@both
def test_a_beam_into_the_very_corner_is_turned_by_both_mirrors(caster):
    world = world_of((5, 0, 9, 4, PERFECT), (5, 0, 9, -4, PERFECT), (-3, -1, -3, 1, WHITE))
    assert caster(world).chains(AHEAD, (0, 0, 0)).tolist() == [[0, 1, 2]]
    assert caster(world).cast(AHEAD, (0, 0, 0)).ranges.tolist() == [13.0]


@both
def test_glass_returns_an_echo_and_lets_the_beam_through(caster):
    world = world_of((2, -1, 2, 1, "glass"), (5, -9, 5, 9, WHITE))
    scan = caster(world).cast(replace(AHEAD, echoes=3), (0, 0, 0))
    assert scan.echoes.tolist() == [[2.0, 5.0, np.inf]]
    glass = Material.of("glass")
    mirrored, passed = shares(1.0, surface_of(glass))
    lobe = math.radians(glass.lobe_deg)
    want = [(glass.diffuse + mirrored / (2 * lobe**2)) / 4, passed**2 / 25, 0.0]
    assert scan.echo_intensities[0] == pytest.approx(want, rel=1e-12)
    for echo, distance in {"first": 2.0, "last": 5.0, "strongest": 2.0}.items():
        assert caster(world).cast(replace(AHEAD, echo=echo), (0, 0, 0)).ranges[0] == distance
    # Seen aslant it returns next to nothing, and the wall behind is the strongest echo.
    assert caster(world).cast(AHEAD, (0, 0.5, 0.3)).walls.tolist() == [1]


@both
def test_limits_hold_for_the_whole_way(caster):
    world = world_of((2, -1, 2, 1, PERFECT), (-4, -1, -4, 1, WHITE))
    for lrf, want in [
        (replace(AHEAD, range_max=8.0), 8.0),
        (replace(AHEAD, range_max=np.nextafter(8.0, 0.0)), np.inf),
        (replace(AHEAD, range_min=8.0), 8.0),
        (replace(AHEAD, range_min=np.nextafter(8.0, 9.0)), -np.inf),
        (replace(AHEAD, range_min=5.0), 8.0),
    ]:
        assert caster(world).cast(lrf, (0, 0, 0)).ranges[0] == want


@pytest.mark.parametrize("seed", range(12))
def test_echoes_in_any_world_are_those_of_the_rationals(seed):
    rng = np.random.default_rng(seed)
    walls, lrf, poses = lit(rng)
    world = World(walls, np.arange(len(walls)), materials=rng.choice(NAMES, len(walls)).tolist())
    exact, lrf = ExactLight(world.segments, list(world.materials)), replace(lrf, echoes=5)
    for pose in poses:
        scan, other = (caster(world).cast(lrf, pose) for caster in CASTERS)
        for name in ("ranges", "walls", "intensities", "echoes", "echo_intensities"):
            assert (getattr(scan, name) == getattr(other, name)).all()
        for beam, direction in enumerate(lrf.directions(pose)):
            found = exact.echoes(tuple(pose[:2]), tuple(direction), range_max=lrf.range_max)
            # Walls that are drawn over each other return light from one place, in any order.
            kept = sorted((round(float(echo.way), 7), -echo.intensity) for echo in found[:5])
            echoes = zip(scan.echoes[beam], -scan.echo_intensities[beam], strict=True)
            seen = sorted((round(way, 7), light) for way, light in echoes if np.isfinite(way))
            assert np.ravel(seen) == pytest.approx(np.ravel(kept), rel=1e-7)


def test_of_more_echoes_than_are_reported_the_brightest_stay():
    mirror = Material("dusty mirror", diffuse=0.02, specular=0.97)
    pane = Material("pane", diffuse=0.01, specular=0.2, transmission=0.78)
    places = {1.1: mirror, -1.0: mirror, 0.6: pane, -0.45: pane}
    world = world_of(*((x, -9, x, 9, kind) for x, kind in places.items()))
    exact = ExactLight(world.segments, list(world.materials))
    lrf = LaserRangeFinder(-0.5, 0.5, beams=11, range_max=20.0, echoes=5)
    scans = [caster(world).cast(lrf, (0, 0, 0)) for caster in CASTERS]
    assert np.array_equal(scans[0].echoes, scans[1].echoes)
    for beam, ahead in enumerate(lrf.directions((0, 0, 0))):
        found = exact.echoes((0.0, 0.0), tuple(ahead), range_max=20.0)
        assert len(found) > 16
        kept = sorted(float(echo.way) for echo in found[:5])
        assert scans[0].echoes[beam] == pytest.approx(kept, rel=1e-14)
