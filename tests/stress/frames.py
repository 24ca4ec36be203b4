"""The cases of drawing: worlds of extreme sizes and places, by both renderers.

A picture counts as broken where it has one colour alone. A world far from the origin must look as
it does there, but for rounding: the error is the root mean square of the difference, of 255.
"""

from functools import partial

import numpy as np

from lrf3d.casting import PlanarCaster
from lrf3d.geometry import Float
from lrf3d.laser import LaserRangeFinder
from lrf3d.mapping import LineMapper
from lrf3d.robot import Trajectory
from lrf3d.run import Run
from lrf3d.simulation import simulate
from lrf3d.world import World
from stress.cases import Case, check

SIZE = (160, 90)
"""Width and height of the pictures [pixels]."""

VIEWS = ("chase", "first", "orbit", "top")
"""Cameras that pictures are taken by."""

MOVES = (2.0**10, 2.0**20, 2.0**23)
"""How far worlds are moved [m]: powers of two, so that the walls stay what they are."""

SCALES = (1e-3, 1e-1, 1e1, 1e3, 1e5)
"""Sizes of rooms, of 10 m at 1."""


def _room(rng: np.random.Generator, scale: float) -> Float:
    """A room with a few things in it, on a grid that moving it keeps."""
    corners = scale * np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 8.0], [0.0, 8.0]])
    room = np.column_stack([corners, np.roll(corners, -1, axis=0)])
    place = scale * rng.uniform(1.0, 6.0, (3, 2))
    things = np.column_stack([place, place + scale * rng.uniform(0.3, 1.0, (3, 2))])
    return np.vstack([room, things])


def _run(walls: Float, place: Float) -> Run:
    world = World(walls)
    poses = np.column_stack([np.tile(place, (4, 1)), [0.3, 0.4, 0.5, 0.6]])
    drive = Trajectory(0.2 * np.arange(4), poses)
    lrf = LaserRangeFinder(beams=61, range_max=30.0)
    return simulate(world, drive, lrf, caster=PlanarCaster(world), mapper=LineMapper(), rng=0)


def _picture(run: Run, view: str, renderer: str) -> Float:
    from lrf3d.render.film import Film
    from lrf3d.render.video import choose_renderer

    film = Film(
        run, size=SIZE, view=view, samples=0, renderer=choose_renderer(renderer), layers=LAYERS
    )
    try:
        return np.array(film.draw(0.4)[:, :, :3], dtype=np.float64)
    finally:
        film.close()


LAYERS = ("shadow", "trail", "fan", "beams", "trace", "points")
"""What is drawn: all but words and the inset, which tell the place itself."""


def moved(renderer: str, rng: np.random.Generator) -> Float:
    """The same room here and far away."""
    walls, move = np.round(4096.0 * _room(rng, 1.0)) / 4096.0, float(rng.choice(MOVES))
    view = str(rng.choice(VIEWS))
    here = _picture(_run(walls, np.array([5.0, 4.0])), view, renderer)
    there = _picture(_run(walls + move, np.array([5.0, 4.0]) + move), view, renderer)
    return np.array([np.sqrt(np.mean((here - there) ** 2))])


def scaled(renderer: str, rng: np.random.Generator) -> Float:
    """Rooms from a centimetre to a thousand kilometres: there is something to see."""
    scale = float(rng.choice(SCALES))
    run = _run(_room(rng, scale), scale * np.array([5.0, 4.0]))
    picture = _picture(run, str(rng.choice(VIEWS)), renderer)
    return np.array([0.0 if np.ptp(picture) > 0.0 else np.inf])


def _cases() -> tuple[Case, ...]:
    found = []
    for renderer, title in (("gl", "OpenGL"), ("embree", "Embree")):
        found += [
            check("frames", f"{title}: rooms up to 8,000 km away", partial(moved, renderer),
                  bound=1.0, unit="of 255", tries=100, each=25),
            check("frames", f"{title}: rooms of 1 cm to 1,000 km", partial(scaled, renderer),
                  bound=0.0, unit="pictures of one colour", tries=40, each=10),
        ]  # fmt: skip
    return tuple(found)


FRAMES = _cases()
"""The cases of drawing."""
