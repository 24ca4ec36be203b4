"""Images in panes that returned no light are told from dark walls by how their light changes."""

import numpy as np
import pytest

from lrf3d.laser.light import shares
from lrf3d.mapping.robust.hidden_panes import hidden_images

USUAL = 0.3
WALL = np.array([0.0, 0.4, 6.0, 1.4])
FRAME = np.array([[-6.0, 0.0, 0.0, 0.0], [4.0, 0.0, 10.0, 0.0]])
FOOTS = np.linspace(0.4, 0.9, 6)
LASERS = np.column_stack([np.linspace(-4.0, -2.0, 6), np.linspace(2.0, 3.0, 6)])
DOWN = np.array([1.0, -1.0])


def image(reflectance=None):
    """Returns from the image of WALL in a pane between FRAME, and the segment that they are of.

    With a reflectance they are those of a diffuse wall there instead.
    """
    wall = WALL.reshape(2, 2)
    places = (wall[0] + FOOTS[:, None] * (wall[1] - wall[0])) * DOWN
    units = (places - LASERS) / np.hypot(*(places - LASERS).T)[:, None]
    along = (wall[1] - wall[0]) * DOWN / np.hypot(*(wall[1] - wall[0]))
    cosine = np.abs(units[:, 0] * along[1] - units[:, 1] * along[0])
    mirrored = np.array([shares(slope, 0.0, 0.0, 0.0, 1.52)[0] for slope in np.abs(units[:, 1])])
    bright = cosine * (USUAL * mirrored**2 if reflectance is None else reflectance)
    returns = np.column_stack([places, LASERS, bright, np.full(6, 0.02)])
    return returns, np.concatenate([places[0], places[-1]])


def found(returns, segment, walls, known=None):
    known = np.zeros(len(returns), bool) if known is None else known
    walls = np.vstack([walls, segment])
    return hidden_images(returns, known, walls, walls, USUAL).tolist()


def test_images_in_a_pane_between_two_walls_are_found_by_their_light():
    assert found(*image(), [WALL, *FRAME]) == [True] * 6


def test_the_places_of_returns_and_the_ends_of_walls_may_be_a_little_off():
    returns, segment = image()
    returns[:, :2] += np.random.default_rng(0).normal(0.0, 0.02, (6, 2))
    frame = FRAME + np.array([[0.0, 0.0, -0.05, 0.03], [0.06, -0.04, 0.0, 0.0]])
    assert found(returns, segment, [WALL, *frame]) == [True] * 6


@pytest.mark.parametrize("reflectance", [0.01, 0.03, 0.1])
def test_a_dark_wall_behind_a_gap_is_none(reflectance):
    assert found(*image(reflectance), [WALL, *FRAME]) == [False] * 6


def test_what_is_as_bright_as_walls_is_none():
    returns, segment = image()
    returns[:, 4] *= 0.6 * USUAL / returns[:, 4].min()
    assert found(returns, segment, [WALL, *FRAME]) == [False] * 6


def test_without_a_wall_that_is_mirrored_or_the_frame_of_the_pane_there_is_none():
    returns, segment = image()
    assert found(returns, segment, FRAME) == [False] * 6
    assert found(returns, segment, [WALL, FRAME[0]]) == [False] * 6


def test_a_wall_through_the_gap_leaves_no_pane():
    returns, segment = image()
    post = np.array([2.0, -0.5, 2.0, 1.0])
    assert found(returns, segment, [WALL, *FRAME, post]) == [False] * 6


def test_what_flashes_is_glass_itself():
    returns, segment = image()
    flash = returns[2].copy()
    flash[4] = 10.0 * USUAL
    assert not any(found(np.vstack([returns, flash]), segment, [WALL, *FRAME]))


def test_an_image_goes_on_up_to_where_the_wall_is_bright():
    returns, segment = image()
    bright = returns.copy()
    way = segment[2:] - segment[:2]
    bright[:, :2] += 1.2 * way
    bright[:, 2:4] = bright[:, :2] + [3.0, 9.0]
    bright[:, 4] = USUAL
    segment[2:] += 1.2 * way
    both = np.vstack([returns, bright])
    assert found(both, segment, [WALL, *FRAME]) == [True] * 6 + [False] * 6


def test_what_is_known_stays_known():
    returns, segment = image(0.1)
    known = np.arange(6) == 2
    assert found(returns, segment, [WALL, *FRAME], known) == known.tolist()
    assert found(returns[:2], segment, [WALL, *FRAME]) == [False] * 2
    assert not len(hidden_images(np.empty((0, 6)), np.empty(0, bool), FRAME, FRAME, USUAL))


@pytest.mark.parametrize("bend, image_of_a_wall", [(0.0, True), (0.25, False)])
def test_every_return_lies_behind_the_pane_as_the_wall_lies_before_it(bend, image_of_a_wall):
    returns, segment = image()
    way = segment[2:] - segment[:2]
    aside = np.array([-way[1], way[0]]) / np.hypot(*way)
    returns[:, :2] += 0.2 * aside
    segment += np.tile(0.2 * aside, 2)
    returns[1:5, :2] += bend * aside
    assert found(returns, segment, [WALL, *FRAME]) == [image_of_a_wall] * 6
