"""The light that returns to a laser: what surfaces reflect and let through, and the laser equation.

These are functions of plain numbers, because casters compile them. Intensities are relative: 1 is
that of a white wall at 1 m that is met at a right angle.

The laser equation is that of W. Wagner et al., "Gaussian decomposition and calibration of a novel
small-footprint full-waveform digitising airborne laser scanner", 2006, for targets wider than the
beam. Shares of a pane follow Fresnel's equations for unpolarised light, summed over all reflections
between its two faces (M. Born and E. Wolf, "Principles of Optics", section 1.5).
"""

import math

CLOSEST = 0.01
"""Distance [m] up to which intensities do not depend on the distance."""

LEAST_SHARE = 0.01
"""Least share of the light, there and back, with which a beam goes on: less is lost in the noise of
all but the strongest echoes."""


def shares(
    cos: float, diffuse: float, specular: float, transmission: float, index: float
) -> tuple[float, float]:
    """Shares of the light that a surface reflects in its lobe and lets through, at an incidence.

    Cos is the cosine of its angle. Without the refractive index of a pane, 0, the shares are those
    of the material: specular and transmission. The diffuse share is lost to both.
    """
    if index == 0.0:
        return specular, transmission
    sin = math.sqrt(max(0.0, 1.0 - cos * cos)) / index
    inside = math.sqrt(max(0.0, 1.0 - sin * sin))
    across, along = 1.0, 1.0
    if cos + inside > 0.0:
        across = ((cos - index * inside) / (cos + index * inside)) ** 2
        along = ((inside - index * cos) / (inside + index * cos)) ** 2
    # With the share R at each face, 2 R / (1 + R) of each polarisation is mirrored.
    mirrored = across / (1.0 + across) + along / (1.0 + along)
    return (1.0 - diffuse) * mirrored, (1.0 - diffuse) * (1.0 - mirrored)


def brightness(
    cos: float, sin: float, diffuse: float, retro: float, mirrored: float, lobe: float
) -> float:
    """How bright a lit surface is for the laser, compared with a white wall at a right angle.

    The lobe [rad] about the mirrored direction is Gaussian, with the mirrored share of the light.
    Seen from the laser its middle lies twice the angle of incidence away.
    """
    bright = (diffuse + retro) * cos
    # Beyond forty standard deviations float64 has no light left, and exp takes its longest.
    if mirrored > 0.0 and lobe > 0.0 and sin < 20.0 * lobe:
        angle = 2.0 * math.atan2(sin, cos) / lobe
        # A share of 1 that is reflected diffusely has the density 1 / π along the normal.
        bright += mirrored / (2.0 * lobe * lobe) * math.exp(-0.5 * angle * angle)
    return bright


def intensity(bright: float, distance: float, near_field: float) -> float:
    """The laser equation: intensity of the light from a surface of a brightness at a distance [m].

    In the near field the image of the spot is larger than the detector, which catches the share
    1 − exp(−2 (distance / near_field)²) of its light (W. Fang et al., "Intensity correction of
    terrestrial laser scanning data by estimating laser transmission function", 2015).
    """
    away = max(distance, CLOSEST)
    value = bright / (away * away)
    if near_field > 0.0:
        value *= math.expm1(-2.0 * (away / near_field) ** 2) / math.expm1(-2.0 / near_field**2)
    return value
