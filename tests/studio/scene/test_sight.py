"""Worlds that are hard to draw: empty, of slivers, far away, without end; all are drawn."""

import numpy as np
import pytest
from estimates import estimated
from test_render import box, city_run, needs_gl, run_of

from lrf3d import LaserRangeFinder, LineMap, Run, Trajectory, World
from lrf3d.studio.gltf import run_glb
from lrf3d.studio.page.session import PageSession, Wanted
from lrf3d.studio.scene.look import SECTION
from lrf3d.studio.scene.stage.stage import paint_stage, stage_of
from lrf3d.studio.scene.stage.structures import SIGHT_DISTANCE, Sight, Structures

FAR = 1e7


def tall(segments, objects=None, height=8.0):
    return World(segments, objects, np.full(len(segments), height))


HOUSE = box(0, 0, 10, 8)
TWO = np.repeat([0, 1], 4)
WORLDS = {
    "no wall": World(np.empty((0, 4))),
    "one wall": tall([[0, 5, 10, 5]]),
    "a low wall": tall([[0, 5, 10, 5]], height=0.01),
    "a high wall": tall([[0, 5, 10, 5]], height=1e7),
    "sloping walls": tall([[0, 9, 70, 39], [0, 14, 70, 44]], [0, 1]),
    "walls of no size": tall([[0, 0, 5e-324, 0], [0, 1, 0, 1 + 1e-15]], [0, 1]),
    "two houses far apart": tall(np.vstack([HOUSE, box(300, 0, 10, 8)]), TWO),
    "a house far off": tall(np.add(HOUSE, 90e3)),
    "a bow tie": tall([[0, 0, 10, 10], [10, 10, 10, 0], [10, 0, 0, 10], [0, 10, 0, 0]]),
    "a wall beyond all": tall([*HOUSE, [FAR, 0, FAR, 9]], [0] * 4 + [1]),
    "glass beyond all": World(
        [*HOUSE, [FAR, 0, FAR, 9]], [0] * 4 + [1], [8.0] * 5, materials=["brick", "glass"]
    ),
    "trees alone": World(
        [*box(3, 5, 0.3, 0.3), *box(9, 5, 0.4, 0.4)], TWO, [7.0] * 8, materials=["bark"] * 2
    ),
    "a low tree in a room": World(
        [*HOUSE, *box(3, 5, 0.3, 0.3)], TWO, [2.5] * 4 + [3.4] * 4, materials=[None, "bark"]
    ),
    "a room and a wall beyond all": tall([*HOUSE, [FAR, 0, FAR, 9]], [0] * 4 + [1], 2.5),
    "a corner beyond all": tall([[0, 0, 10, 0], [10, 0, FAR, 8], [FAR, 8, 0, 8], [0, 8, 0, 0]]),
    "a wall without end": tall([*HOUSE, [-FAR, -9, FAR, -9.5]], [0] * 4 + [1]),
    "a fence round all": tall(np.vstack([HOUSE, box(-FAR, -FAR, 2 * FAR, 2 * FAR)]), TWO),
}


def driven(world):
    """A run past the house, or past where one would stand."""
    poses = np.column_stack([np.linspace(-5, 160, 9), np.full(9, -5.0), np.zeros(9)])
    if len(world.segments):
        return run_of(world, 0.5 * np.arange(9), poses)
    lrf, none = LaserRangeFinder(beams=91), np.full((9, 91), np.inf)
    walls = np.full((9, 91), -1)
    trajectory = Trajectory(0.5 * np.arange(9), poses)
    return Run(world, lrf, trajectory, none, none, walls, (0,), (LineMap.empty(),))


@pytest.mark.slow
@needs_gl
@pytest.mark.parametrize("world", WORLDS.values(), ids=WORLDS)
def test_every_world_is_drawn_from_every_camera_and_written_for_viewers(world):
    from lrf3d.studio.render.film import frame
    from lrf3d.world.cameras import MOVING_VIEWS

    run = driven(world)
    # What is drawn is the same for both renderers.
    for view, renderer in (*((view, "gl") for view in MOVING_VIEWS), ("story", "embree")):
        picture = frame(run, 2.1, size=(64, 48), view=view, samples=0, renderer=renderer)
        assert picture.shape == (48, 64, 3)
    assert run_glb(run)[:4] == b"glTF"
    assert PageSession.played(run, 1.0).answer(Wanted(), 0.0)


def ground_of(structures):
    return paint_stage(structures).ground


@pytest.mark.parametrize("heights", [2.5, 8.0])
def test_a_large_hall_is_indoors_whatever_its_height_and_a_house_passed_by_is_not(heights):
    # A rack in it is no house.
    world = tall([*box(0, 0, 60, 25), *box(10, 10, 30, 1)], TWO, heights)
    assert Structures.from_world(world, np.array([[5.0, 5.0], [55.0, 5.0]])).indoor
    assert not Structures.from_world(tall(HOUSE), np.array([[-9.0, 0.0], [-9.0, 5.0]])).indoor


@pytest.mark.parametrize("name", [name for name in WORLDS if "all" in name or "end" in name])
def test_walls_beyond_the_distance_of_sight_are_not_drawn(name):
    run = driven(WORLDS[name])
    structures = Structures.from_run(run)
    places = structures.segments.reshape(-1, 2) + structures.origin
    assert (np.abs(places) <= SIGHT_DISTANCE + 200.0).all()
    # So that float32 knows millimetres where the robot is.
    assert np.abs(structures.origin).max() < SIGHT_DISTANCE
    assert ground_of(structures).size.max() < 4.0 * SIGHT_DISTANCE


def test_walls_in_sight_stay_as_they_are_and_others_are_cut():
    path = np.array([[0.0, 0.0], [10.0, 0.0]])
    world = tall(HOUSE)
    assert Sight.of(world, path).world is world
    assert Sight.of(world).world is world
    walls = np.array(
        [[0.1, 0.2, 0.3, 0.4], [-FAR, 1.0, FAR, 1.0], [FAR, 0, FAR, 1], [9e3, 0, 5, 0]]
    )
    seen = Sight.of(World(walls, [5, 2, 1, 0], [1.0, 2.0, 3.0, 1e6]), path).world
    ends = [
        [0.1, 0.2, 0.3, 0.4],
        [-SIGHT_DISTANCE, 1.0, SIGHT_DISTANCE + 10.0, 1.0],
        [SIGHT_DISTANCE + 10.0, 0.0, 5.0, 0.0],
    ]
    assert seen.segments[0].tolist() == ends[0]
    assert seen.segments == pytest.approx(np.array(ends), abs=1e-6)
    assert seen.objects.tolist() == [5, 2, 0]
    assert seen.heights.tolist() == [1.0, 2.0, SIGHT_DISTANCE]
    nothing = Sight.of(tall(np.add(HOUSE, 90e3)), path)
    assert not len(nothing.world.segments) and nothing.origin.tolist() == [5.0, 0.0]


def test_walls_known_from_scans_alone_are_low_and_others_as_high_as_they_are():
    run = run_of(tall(HOUSE), np.arange(3.0), [(-5, 0, 0), (-5, 1, 0), (-5, 2, 0)])
    recorded = estimated(run, shift=(0.0, 0.0, 0.0))
    assert Structures.from_run(run).heights == pytest.approx(8.0)
    assert Structures.from_run(recorded).heights == pytest.approx(SECTION)
    assert recorded.world.heights == pytest.approx(8.0)


def test_the_stage_of_a_run_is_painted_once():
    run, other = (city_run.__wrapped__() for _ in range(2))
    stage = stage_of(run)
    assert stage_of(run) is stage
    again = stage_of(other)
    assert again is not stage and np.array_equal(again.ground.picture, stage.ground.picture)
    for first, second in zip(stage.faces, again.faces, strict=True):
        assert np.array_equal(first, second)
