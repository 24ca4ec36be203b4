"""The constants of the look, for all pictures: colours, light, and sizes of what is drawn.

Colours are red, green, blue in 0…1, as a screen shows them.
"""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from lrf3d.geometry.lines import Float
from lrf3d.world import World

# Direction to the brightest part of the sky, of unit length.
SUN = np.array([0.33, -0.37, 0.868])

# How bright a wall or roof is everywhere, how much brighter the more it looks at the sun, and what
# is left of that at its foot.
WALL_LIGHT = (0.72, 0.24, 0.80)

# Colour of walls, and the share that colours of their own have in those of a town: off-white clay,
# so that strong colours belong to the laser and the map.
CLAY = np.array([0.90, 0.885, 0.86])
OWN_SHARE = 0.25

# Colours of what is far away, and of the sky overhead.
HAZE = (0.055, 0.078, 0.125)
ZENITH = (0.039, 0.055, 0.09)

# What black becomes where no beam has been: a model at night.
NIGHT_LOW = (0.039, 0.059, 0.094)

# Colour of fresh light; the share of the surface that it covers, what it adds to black, and what it
# adds for the brightness of the surface: pure mixing is brown mud, pure adding burns out.
EMBER = (1.0, 0.749, 0.451)
EMBER_SHARE = (0.45, 0.16, 0.72)

# Time in which a place becomes lit [s of the film]; how light fades with the height [1/m], and its
# least share.
DAWN = 0.6
FALL = 0.04
LEAST_FALL = 0.30

# Share of the map's colour in a mapped wall, how bright that is on black and on white, and its
# share in a roof.
MAP_SHARE = 0.84
MAP_LIGHT = (0.26, 1.10)
ROOF_SHARE = 0.30

# Speed at which the map's colour climbs a wall [m/s of the film], and how high its bright front is
# [m].
CLIMB = 14.0
FRONT = 1.6

# Radius of the opening round the robot in what hides it, as a share of the distance, and the share
# of the walls that is left out there.
PEEP = 0.10
VEIL_SHARE = 0.80

# Opacity of a scan's light on the ground at the robot, and what mirrors leave of light.
LAMP = 0.28
REFLECTED = (0.70, 0.78, 0.90)

# Colour and opacity of the edges of houses, and the opacity of panes of glass.
OUTLINE = (0.435, 0.561, 0.769)
OUTLINE_STRENGTH = 0.42
PANE = 0.10

# Colour of the object that has more than this share of a map's length: the walls of a house that
# hold everything else.
PALE_OBJECT = (0.765, 0.812, 0.886)
PALE_FROM = 0.4

# How bright a body is everywhere, how much brighter in the sun, and on what looks up.
BODY_LIGHT = (0.70, 0.30, 0.06)

# Share of opacity that walls that were never seen lose as they turn to glass, of haze's colour.
GHOST_STRENGTH = 0.86

# Height [m] at which the walls of rooms are cut, as architects draw them: just above the bands of
# the map.
SECTION = 0.8

# By how much finer copies of the ground's picture are taken, as streets are seen at a slant; the
# size of the bloom round a hit point, in its diameters, and its opacity at the point.
GROUND_SHARPNESS = 0.6
POINT_HALO = 2.6
POINT_HALO_STRENGTH = 0.34

# Colour of the robot's trail, and its height over the ground [m].
TRAIL_COLOUR = (1.0, 0.702, 0.353)
TRAIL_HEIGHT = 0.015

# Colour of the estimated trail, and opacity of the ellipses that it leaves behind.
ESTIMATE_COLOUR = (0.93, 0.09, 0.60)
ESTIMATE_FADED = 0.45

# Colour of the inset where nothing is known, 0…255, and of what was seen in it; lines and points
# are at least this number of times their size at 720 lines.
PLAN_BACK = (11, 16, 26)
EXPLORED = (0.153, 0.204, 0.294)
LEAST_SCALE = 0.62

# The largest world [m] that the inset shows whole, and what it shows of a larger one.
INSET_WHOLE = 1400.0
INSET_FOLLOWED = 110.0

# Colour of the robot, and its outline (4, 2) as seen from above, heading along x.
ROBOT = (0.98, 0.46, 0.06)
DART = np.array([[1.1, 0.0], [-0.8, 0.75], [-0.4, 0.0], [-0.8, -0.75]])


class Rig(NamedTuple):
    """How a camera looks at the robot: its distance [m], and how steeply at the least [degrees].

    The angle of view [degrees], and how far the picture is moved up, in halves of its height.
    """

    away: float
    steep: float
    field: float
    shift: float = 0.0


class Setting(NamedTuple):
    """Settings that differ between the streets of a town and the rooms of a house."""

    night: tuple[float, float, float]
    cool: tuple[float, float, float]
    """What white becomes where no beam has been; factors of the colours of what one has met."""
    haze: float
    """Distance at which half of what is seen is haze [m]."""
    beams: float
    """Range at which drawn beams have faded to nothing [m]: farther ones would tint the street."""
    cell: float
    before: float
    """Side of a cell of the first-seen times [m]; and cells from a wall to the one that it looks
    at: light does not leak under the wall."""
    light: float
    """Speed of light in the picture [m/s of the film]: a scan comes as a wave."""
    pixel: float
    margin: float
    """Smallest pixel of the ground's picture, finer than which a small place shows no more, and how
    far that picture, and with it light on the ground, reaches past walls [m]."""
    land: int
    """Brightness of a street, or of the land round a house, 0…255."""
    shade: float
    """How far the loss of light next to walls reaches [m]."""
    chase: Rig
    orbit: Rig
    wave: Rig
    """How cameras go behind the robot, round it, and look down on its first scan."""
    steep: float
    """How steeply an overview looks down [rad]: more into rooms, so that near walls hide less."""


TOWN = Setting(
    night=(0.149, 0.2, 0.286), cool=(1.02, 1.10, 1.24), haze=190.0, beams=42.0, cell=0.25,
    before=1.4, light=110.0, pixel=0.06, margin=30.0, land=108, shade=1.2,
    chase=Rig(4.1, 24.0, 50.0, -0.45), orbit=Rig(7.0, 20.0, 46.0, -0.3),
    wave=Rig(44.0, 62.0, 46.0), steep=float(np.radians(42.0)),
)  # fmt: skip
ROOMS = Setting(
    night=(0.122, 0.165, 0.243), cool=(0.74, 0.82, 0.95), haze=120.0, beams=14.0, cell=0.08,
    before=2.0, light=26.0, pixel=0.02, margin=3.0, land=96, shade=0.25,
    chase=Rig(4.4, 33.0, 50.0, -0.3), orbit=Rig(7.0, 38.0, 42.0),
    wave=Rig(11.0, 60.0, 46.0), steep=float(np.radians(56.0)),
)  # fmt: skip


# Colours of mirrors, glass and retro-reflectors that have none of their own.
MATERIAL_COLOURS = {
    "mirror": (0.80, 0.85, 0.90),
    "glass": (0.62, 0.82, 0.86),
    "retro": (0.93, 0.80, 0.22),
}


def object_colours(world: World, *, indoor: bool) -> Float:
    """Colours (objects, 3) of a world's objects: their own, their material's, or clay."""
    numbers = np.arange(world.object_count)
    chosen = np.tile(CLAY, (len(numbers), 1))
    # Multiples of the plastic number's inverse are far apart for neighbours: so is brightness, and
    # two houses of one colour do not look the same.
    chosen *= (0.94 + 0.10 * np.mod(numbers * 0.7548776662, 1.0))[:, None]
    given = np.full((world.object_count, 3), np.nan)
    rows = min(len(world.colours), world.object_count)
    given[:rows] = world.colours[:rows]
    if not indoor:
        given = chosen + OWN_SHARE * (given - CLAY)
    for number, one in enumerate(world.materials):
        if one is not None and (one.passes or one.mirrors or one.retro > 1.0):
            kind = "glass" if one.passes else "mirror" if one.mirrors else "retro"
            chosen[number] = MATERIAL_COLOURS[kind]
    return np.clip(np.where(np.isnan(given), chosen, given), 0.0, 1.0)


def paler(colour: Iterable[float]) -> list[float]:
    """A colour for text on a dark ground, where it is read more easily."""
    return [0.65 * part + 0.35 for part in colour]
