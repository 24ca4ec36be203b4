"""The look of all pictures: colours, light, and sizes of what is drawn.

Colours are red, green, blue in 0…1, as a screen shows them.
"""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from lrf3d.geometry.lines import ROUNDING, Float
from lrf3d.world import World

Colour = tuple[float, float, float]

# Width and height of the usual picture [pixels].
SIZE = (1280, 720)

# Height of the picture that sizes in pixels are given for [pixels].
LINES = SIZE[1]

# The brightest value of a channel of a picture in whole numbers.
WHITE = 255.0

# The least length that is divided by [m]: what is shorter has no direction.
TINY = ROUNDING


def rgb(code: str, digits: int = 3) -> Colour:
    """A colour of ``#rrggbb``, with three digits as in shaders, or two as it was chosen."""
    red, green, blue = (round(part / WHITE, digits) for part in bytes.fromhex(code[1:]))
    return red, green, blue


def scale(size: tuple[int, ...], least: float = 0.0) -> float:
    """How much larger than at 720 lines things are in a picture of a size [pixels], at least."""
    return max(least, min(size) / LINES)


# Direction to the brightest part of the sky, of unit length.
SUN = np.array([0.33, -0.37, 0.868])

# Brightness of a wall or roof everywhere, how much brighter it is facing the sun, and the factor of
# both at the foot of a wall.
WALL_LIGHT = (0.72, 0.24, 0.80)

# Weights of red, green and blue in brightness, about those of the eye.
GREY = (0.3, 0.55, 0.15)

# Colour of walls: off-white clay, so that strong colours belong to the laser and the map.
CLAY = np.array(rgb("#e6e2db"))

# Share that their own colours have in those of the houses of a town.
OWN_SHARE = 0.25

# Colour of what is far away.
HAZE = rgb("#0e1420")

# Colour of the sky overhead.
ZENITH = rgb("#0a0e17")

# Distance at which half of what is seen is haze [m].
HAZY = 190.0

# What black becomes where no beam has been: a model at night.
NIGHT_LOW = rgb("#0a0f18")

# What white becomes there.
NIGHT_HIGH = rgb("#232f44")

# What white becomes there once the first scan has been seen: the model stands in dusk.
DUSK = rgb("#56688a")

# Colour of fresh light.
EMBER = rgb("#ffbf73")

# Share of a surface that fresh light covers, what it adds to black, and what it adds for the
# brightness of the surface: pure mixing is brown mud, pure adding burns out.
EMBER_SHARE = (0.45, 0.16, 0.72)

# Time in which a place becomes lit [s of the film].
DAWN = 0.6

# Height of a storey of a house [m].
STOREY = 3.1

# Height of a shelf of a rack [m].
SHELF = 0.78

# Width of the soft edge of light, as a difference in how surely places were seen.
RIM = 0.32

# How light fades with the height [1/m]: that of a lamp so low does not reach high walls.
FALL = 0.04

# Least share of light that is left of that.
LEAST_FALL = 0.30

# Share of the map's colour in a mapped wall.
MAP_SHARE = 0.84

# How much less of it tops have, which no beam meets.
TOP_TINT = 0.12

# How bright the map's colour is on black, and how much brighter on white.
MAP_LIGHT = (0.26, 1.10)

# Speed at which the map's colour climbs a wall [m/s of the film].
CLIMB = 14.0

# Height of the bright front of that colour [m].
FRONT = 1.6

# Opacity of a scan's light on the ground at the robot.
LAMP = 0.28

# What mirrors leave of light: they are slightly blue.
REFLECTED = rgb("#b3c7e6")

# Colour of the edges of houses.
OUTLINE = rgb("#6f8fc4")

# Opacity of the edges of houses.
OUTLINE_STRENGTH = 0.42

# Width of the finest lines, such as beams and edges of houses [pixels of 720 lines].
FINE = 1.1

# Width of bold lines, such as those of the map and trails [pixels of 720 lines].
BOLD = 3.2

# Opacity of panes of glass.
PANE = 0.16

# Colours of the walls of a map, from the one that was found first to the last.
FOUND = np.array([rgb(code) for code in ("#c58cff", "#6fa2ff", "#34d5d5", "#7fe57f", "#f2ec5e")])

# Colour of the walls of a map beside others that is compared with these.
PALE_WALL = rgb("#c3cfe2")

# Brightness of a body everywhere, and how much brighter it is facing the sun, and facing up.
BODY_LIGHT = (0.70, 0.30, 0.06)

# Height at which the walls of rooms are cut, as architects draw them [m]: just above the bands of
# the map.
SECTION = 0.8

# By how much finer copies of the ground's picture are taken [halvings]: streets are seen at a
# slant.
GROUND_SHARPNESS = 0.6

# Size of the bloom round a hit point, in its diameters.
POINT_HALO = 2.6

# Opacity of the bloom at the point.
POINT_HALO_STRENGTH = 0.34

# Colour of the robot's trail.
TRAIL_COLOUR = rgb("#ffb35a")

# Height of trails over the ground [m].
TRAIL_HEIGHT = 0.015

# Colour of the estimated trail: far from those of false walls and of what odometry puts astray.
ESTIMATE_COLOUR = rgb("#5fe6ff")

# Colour of what the map of a world with mirrors holds where there is no wall.
FALSE_COLOUR = rgb("#ff4a5f")

# Opacity of the ellipses that the estimate leaves behind.
ESTIMATE_FADED = 0.45

# Colour of the inset where nothing is known, 0…255.
PLAN_BACK = (11, 16, 26)

# Colour of the inset where something was seen.
EXPLORED = rgb("#27344b")

# Least number of times their size at 720 lines that lines and points have in smaller pictures.
LEAST_SCALE = 0.62

# The largest world that the inset shows whole [m].
INSET_WHOLE = 1400.0

# What the inset shows of a larger world [m].
INSET_FOLLOWED = 110.0

# Colour of the robot: strong, and that of nothing else.
ROBOT = rgb("#fa750f")

# No segments (0, 4).
NOTHING = np.zeros((0, 4))

# Outline (4, 2) of the robot as seen from above, heading along x.
DART = np.array([[1.1, 0.0], [-0.8, 0.75], [-0.4, 0.0], [-0.8, -0.75]])


class Rig(NamedTuple):
    """How a camera looks at the robot."""

    # Distance of the eye [m].
    away: float
    # How steeply it looks down at the least [degrees].
    steep: float
    # Angle of view from the bottom to the top of the picture [degrees].
    field: float = 46.0
    # How far the picture is moved up, in halves of its height.
    shift: float = 0.0


class Setting(NamedTuple):
    """Settings that differ between the streets of a town and the rooms of a house."""

    # Factors of the colours of what a beam has met.
    cool: Colour
    # Range at which drawn beams have faded to nothing [m]: farther ones would tint the street.
    beams: float
    # Side of a cell of the first-seen times [m].
    cell: float
    # Distance of a wall from the cell whose light it has [cells]: light does not leak under it.
    before: float
    # Speed of light in the picture [m/s of the film]: a scan comes as a wave.
    light: float
    # Smallest pixel of the ground's picture [m]: in a small place a finer one shows no more.
    pixel: float
    # How far the ground's picture, and with it light on the ground, reaches past walls [m].
    margin: float
    # Brightness of a street, or of the tiles of a floor, 0…255.
    land: int
    # How far the loss of light next to walls reaches [m].
    shade: float
    # Share of light, and of the map's colour, on tops next to a wall that was seen: no beam meets a
    # roof; walls of rooms are cut instead.
    top: float
    # The camera behind the robot.
    chase: Rig
    # The camera that goes round the robot.
    orbit: Rig
    # How steeply an overview looks down [rad]: more into rooms, so that near walls hide less.
    steep: float


TOWN = Setting(
    cool=(1.02, 1.10, 1.24), beams=42.0, cell=0.25,
    before=1.4, light=110.0, pixel=0.06, margin=30.0, land=108, shade=1.2, top=0.0,
    chase=Rig(4.1, 24.0, 50.0, -0.45), orbit=Rig(7.0, 20.0, shift=-0.3),
    steep=float(np.radians(42.0)),
)  # fmt: skip
ROOMS = Setting(
    cool=(0.74, 0.82, 0.95), beams=14.0, cell=0.08,
    before=2.0, light=26.0, pixel=0.02, margin=3.0, land=150, shade=0.25, top=0.62,
    chase=Rig(4.4, 33.0, 50.0, -0.3), orbit=Rig(7.0, 38.0, 42.0),
    steep=float(np.radians(56.0)),
)  # fmt: skip


# Colours of mirrors, glass and retro-reflectors that have none of their own.
MATERIAL_COLOURS = {
    "mirror": rgb("#ccd9e6", 2),
    "glass": rgb("#9ed1db", 2),
    "retro": rgb("#edcc38", 2),
}


def object_colours(world: World, *, indoor: bool) -> Float:
    """Colours (objects, 3) of a world's objects: their own, their material's, or clay."""
    chosen = np.tile(CLAY, (world.object_count, 1))
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


def gradient(shares: Float, colours: Float) -> Float:
    """Colours (n, 3) at shares 0…1 (n,) of a gradient through others (k, 3)."""
    steps = np.linspace(0.0, 1.0, len(colours))
    return np.column_stack([np.interp(shares, steps, channel) for channel in colours.T])


def paler(colour: Iterable[float]) -> list[float]:
    """A colour for text on a dark ground, where it is read more easily."""
    # Share of white.
    white = 0.35
    return [(1.0 - white) * part + white for part in colour]
