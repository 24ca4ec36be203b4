"""What moves beside the robot, and how a run is filmed: kept with it, and drawn where it is."""

from dataclasses import replace

import numpy as np
import pytest
from test_render import SIZE, city_run, needs_gl, on_picture, room_run

import lrf3d
from lrf3d import DynamicObstacle, Trajectory, load_run, save_run
from lrf3d.casting.dynamic_obstacle import round_outline
from lrf3d.studio.render.film import Film, frame
from lrf3d.world.cameras import FilmPlan

WALK = Trajectory([0.0, 4.0], [(-26.0, 1.0, 0.0), (-20.0, -1.0, 1.5)])
CART = np.array([[1.0, 0.5], [-1.0, 0.5], [-1.0, -0.5], [1.0, -0.5]])
L_SHAPE = np.array([[0, 0], [2, 0], [2, 0.7], [0.7, 0.7], [0.7, 2], [0, 2]]) - 0.6
OBSTACLES = (
    DynamicObstacle(round_outline(0.4), WALK, 1.8),
    DynamicObstacle(CART, Trajectory([0.0], [(-25, 3, 1)]), 1.0),
)
ALL = (*OBSTACLES, DynamicObstacle(L_SHAPE, Trajectory([0.0], [(-12, 0, 2.0)]), 0.8))

RENDERERS = pytest.mark.parametrize("renderer", [pytest.param("gl", marks=needs_gl), "embree"])


def framed(run, time, **settings):
    return frame(run, time, size=SIZE, samples=0, **settings).astype(int)


def test_a_run_keeps_the_radius_that_its_robot_was_planned_with_and_is_drawn_so():
    # In a passage of 0.5 m the usual robot of 0.35 m would stand in its walls.
    passage = lrf3d.World([[0, 0, 8, 0], [8, 0, 8, 0.5], [8, 0.5, 0, 0.5], [0, 0.5, 0, 0]])
    run = lrf3d.Scenario(passage, route=[[1, 0.25], [7, 0.25]], radius=0.2).run(scans=3, rng=0)
    assert run.radius == 0.2
    corners = Film(run, size=SIZE, renderer="embree").scene.robot.faces[0]
    assert 0.15 < np.abs(np.asarray(corners)[..., :2]).max() < 0.25


def test_recordings_and_runs_keep_what_moves_and_how_it_is_filmed(tmp_path):
    film = FilmPlan("top", 3.5, "intensity")
    simulation = lrf3d.Simulation(room_run().world, room_run().trajectory.poses[:3], obstacles=ALL)
    simulation.film = film
    kept = lrf3d.record(simulation, tmp_path / "run.npz")
    save_run(replace(kept, radius=0.18), tmp_path / "again.npz")
    again = load_run(tmp_path / "again.npz")
    assert again.radius == 0.18
    for run in (kept, again):
        assert run.film == film
        for one, own in zip(run.obstacles, ALL, strict=True):
            assert np.array_equal(one.outline, own.outline) and one.height == own.height
            assert np.array_equal(one.path.times, own.path.times)
            assert np.array_equal(one.path.poses, own.path.poses)


@RENDERERS
def test_bodies_are_drawn_where_they_are_and_nowhere_else(renderer):
    run = city_run()
    films = [
        Film(each, size=SIZE, view="orbit", samples=0, renderer=renderer, layers=("shadow",))
        for each in (run, replace(run, obstacles=OBSTACLES))
    ]
    for time in (1.0, 1.1, 3.3):
        bare, moving = (film.draw(time).astype(int) for film in films)
        look = films[1].camera.look(time, SIZE[0] / SIZE[1])
        rows, columns = np.nonzero(np.abs(bare - moving).max(axis=2) > 12)
        assert len(rows) > 20
        origin = np.array([*run.world.origin, 0.0])
        x, y, _ = WALK.at(np.array([time]))[0]
        # All that has changed lies round the walker or the cart, or in their shade.
        spots = np.array([(x, y, 0.9), (-25.0, 3.0, 0.5)])
        pixels = np.array([on_picture(look, spot - origin) for spot in spots])
        away = np.hypot(columns[:, None] - pixels[:, 0], rows[:, None] - pixels[:, 1])
        metre = 0.5 * SIZE[1] / np.tan(0.5 * look.field) / np.linalg.norm(look.eye - look.target)
        assert (away.min(axis=1) < 3.2 * metre).all()
        assert (away.min(axis=0) < 1.0 * metre).all()
    for film in films:
        film.close()
