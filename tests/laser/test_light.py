"""The light of a laser beam: shares at glass and mirrors, brightness of surfaces, intensity."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lrf3d.laser.light import brightness, shares

cosines = st.floats(0.0, 1.0)
unit = st.floats(0.0, 1.0)


@given(cosines, unit, st.floats(1.01, 3.0))
def test_glass_splits_all_light_that_it_does_not_scatter(cos, diffuse, index):
    mirrored, passed = shares(cos, diffuse, 0.0, 0.0, index)
    assert 0.0 <= mirrored <= 1.0 and -1e-12 <= passed <= 1.0
    assert mirrored + passed == pytest.approx(1.0 - diffuse)


@given(st.floats(1.01, 3.0))
def test_glass_at_a_right_angle_mirrors_after_fresnel_at_both_faces(index):
    face = ((index - 1.0) / (index + 1.0)) ** 2
    mirrored, _ = shares(1.0, 0.0, 0.0, 0.0, index)
    assert mirrored == pytest.approx(2.0 * face / (1.0 + face))


@pytest.mark.parametrize("index", [1.0, 1.5])
def test_glass_that_is_grazed_is_a_mirror(index):
    assert shares(0.0, 0.0, 0.0, 0.0, index) == pytest.approx((1.0, 0.0))


@given(cosines, unit, unit)
def test_a_surface_without_a_lobe_is_as_bright_as_its_cosine(cos, diffuse, retro):
    sin = math.sqrt(1.0 - cos * cos)
    expected = (diffuse + retro) * cos
    assert brightness(cos, sin, diffuse, retro, 0.5, 0.0) == pytest.approx(expected)
    assert brightness(cos, sin, diffuse, retro, 0.0, 0.1) == pytest.approx(expected)


def test_the_lobe_of_a_glossy_surface_is_a_gaussian_of_twice_the_angle():
    lobe, angle = 0.2, 0.1
    head_on = brightness(1.0, 0.0, 0.0, 0.0, 0.8, lobe)
    assert head_on == pytest.approx(0.8 / (2.0 * lobe**2))
    tilted = brightness(math.cos(angle), math.sin(angle), 0.0, 0.0, 0.8, lobe)
    assert tilted == pytest.approx(head_on * math.exp(-0.5 * (2.0 * angle / lobe) ** 2))
