"""How a story frames what it shows: not in the dark, the robot in the middle, the map beside it."""

from dataclasses import replace

import numpy as np
import pytest
from test_estimate import estimated
from test_render import city_run, needs_gl, room_run

import lrf3d
from lrf3d.studio.render.beside import Comparison
from lrf3d.studio.render.film import Film, frame
from lrf3d.studio.render.text import lay_pins
from lrf3d.studio.scene.camera import Look
from lrf3d.studio.scene.found import hits_on, lost_after, missed_by
from lrf3d.studio.scene.look import PLAN_BACK
from lrf3d.studio.scene.moments import LAYERS, Scene
from lrf3d.studio.scene.pins import Pins, share_of
from lrf3d.studio.scene.shapes import Lens
from lrf3d.studio.scene.shots import SHOTS
from lrf3d.studio.scene.stage.stage import stage_of
from lrf3d.studio.scene.timeline import Timeline
from lrf3d.studio.scene.views import film_times

# Brightness below which a pixel is black, 0…255.
BLACK = 42.0


def scanned(name):
    """A run of a built-in world with few scans."""
    return lrf3d.load_scenario(name).run(scans=60, rng=0, snapshots=12)


WORLDS = {
    "room": room_run,
    "town": lambda: city_run(seconds=40.0),
    **{
        name: lambda name=name: scanned(name)
        for name in ("paper_room", "glass_office", "warehouse", "corridor", "mirror_hall", "city")
    },
}


# What these are about, one moment proves after the first scan. In so few scans the corridor's false
# walls are not all dropped.
PROVED = ("mirror_hall",)


@pytest.mark.parametrize(
    "world",
    [pytest.param(name, marks=[pytest.mark.slow] * (name != "room")) for name in WORLDS],
)
def test_no_half_of_a_picture_is_black_and_the_robot_is_in_its_middle_not_under_the_map(world):
    film = Film(WORLDS[world](), view="story", size=(160, 90), samples=0)
    assert ("proof" in [shot.name for shot in film.camera.shots]) == (world in PROVED)
    passed = np.arange(0.0, 15.0, 2.0)
    frames = film_times("story", film.timeline, 1.0 / 0.04, 15.0)
    times = frames[(passed / 0.04).astype(int).clip(max=len(frames) - 1)]
    for time in times.tolist():
        view = film._view(time)
        wide, high = film._size
        picture = film.draw(time)[:high, : wide - round(view.inset * film._strip), :3]
        assert (picture @ [0.3, 0.55, 0.15] < BLACK).mean() < 0.5, time
        if view.shot in SHOTS:
            moment = film.timeline.moment(time)
            place = np.append(moment.pose[:2] - film.timeline.origin, [0.3, 1.0])
            x, y, _, w = view.matrix(wide / high, 1000.0) @ place
            column = 80.0 * (1.0 + x / w)
            assert 0.2 < column / picture.shape[1] < 0.8 and abs(y / w) < 0.6, time
    film.close()


@pytest.mark.parametrize("size", [(416, 234), (240, 240), (200, 360)])
def test_the_map_is_beside_the_picture_and_no_text_lies_over_it(size):
    run = estimated(city_run())
    with_text, without = (
        frame(run, 2.0, size=size, layers=layers, view="chase")
        for layers in (LAYERS, set(LAYERS) - {"hud"})
    )
    differ = np.flatnonzero((with_text != without).any(axis=(0, 2)))
    # Below the map its strip is empty.
    strip = np.flatnonzero((without[-3:] == PLAN_BACK).all(axis=(0, 2)))
    assert len(strip) > 0.15 * size[0] and strip[-1] == size[0] - 1
    assert 0 < len(differ) and differ[-1] < strip[0]


def without_a_wall(run):
    """A run whose maps lack their first segment."""
    parts = [(each.segments[1:], each.objects[1:], each.points[1:]) for each in run.maps]
    return replace(run, maps=[lrf3d.LineMap(*part) for part in parts])


def reddish(picture):
    """How many pixels of a picture are red."""
    red, green, _ = np.moveaxis(picture.astype(int), -1, 0)
    return int(((red > 200) & (green < 90)).sum())


def test_the_wall_that_most_maps_miss_is_named_with_how_far_its_hits_scatter():
    scenario = lrf3d.load_scenario("paper_room")
    runs = [scenario.run(sigma=level, rng=0) for level in (0.07, 0.42, 0.63)]
    parts, counts = missed_by(runs)
    (wall,) = parts[counts == 2]
    lost = [lost_after(run, len(run) - 1).tolist() for run in runs]
    assert [wall.tolist() in each for each in lost] == [False, True, True]
    hits, off = zip(*(hits_on(run, wall) for run in runs), strict=True)
    assert {len(each) for each in hits} == {19}
    # Noise shifts the same hits by more.
    assert np.array(off) / off[0] == pytest.approx([1.0, 6.0, 9.0])
    assert not len(missed_by(runs[:1])[0])
    scenes = {str(number): Scene(Timeline(each), None, None) for number, each in enumerate(runs)}
    for size, wide in (((640, 200), 213), ((200, 640), 200)):
        compared = Comparison(scenes, size, "")
        assert compared._cell[0] == wide
        assert len({tuple(each.letters) for each in compared.maps}) == 1
    assert compared.card()[::3] == (
        "Short walls are lost in noise first",
        "2: 10 of 12 walls found",
    )
    view = Look(np.zeros(3), np.ones(3), 1.0, shot="end")
    pins = Pins.of(compared.named, view.away, np.zeros(3))
    assert pins.words == ["1.4 m missed: 2", "92 cm missed: 1, 2"]
    # The robot has seen the wall from where its pin ends.
    away, beside = (
        np.hypot(*(places[0, :2] - runs[0].trajectory.poses[1, :2]))
        for places in (pins.tips, pins.ends)
    )
    assert beside < away
    # What all maps miss is not lost by more noise.
    alike = dict.fromkeys(("one", "two"), scenes["2"])
    assert Comparison(alike, (640, 200), "alike").card()[0] == "alike"


def test_what_pins_say_is_not_laid_over_what_others_say_and_pins_are_small_in_narrow_pictures():
    place = np.zeros((2, 3))
    laid = []
    for count in (1, 2):
        pins = Pins(None, place[:count], place[:count], ["58 cm", "1.0 m"][:count])
        laid.append(np.zeros((200, 320, 3), np.uint8))
        lay_pins(laid[-1], pins, Lens(np.eye(4), np.zeros(3), 1.0, 0.0, 0.0, 1.0), (255, 0, 0))
    assert laid[0].any() and (laid[0] == laid[1]).all()
    assert share_of((640, 300)) == 1.0 and share_of((320, 568)) < 0.4


def test_at_the_end_the_picture_is_all_there_is_and_missed_walls_are_red_in_it():
    run = room_run()
    reds = []
    for each in (run, without_a_wall(run)):
        film = Film(each, view="story", size=(320, 180), layers={"map", "inset"})
        last = film_times("story", film.timeline, 25.0, 15.0)[-1]
        assert film._view(film.timeline.start).inset == 1.0 and film._view(last).inset == 0.0
        reds.append(reddish(film.draw(last)))
        film.close()
    assert reds[1] > reds[0] + 20


@needs_gl
def test_each_robot_has_a_map_of_its_own_to_the_end_and_false_walls_are_red():
    room = lrf3d.load_world("paper_room")
    drives = [[(x, 1.0 + 0.2 * k, 0.5 * k) for k in range(3)] for x in (1.0, 3.5)]
    first, second = lrf3d.simulate_fleet(room, drives, rng=0)
    away = [replace(each, segments=0.2 * each.segments + 1.6) for each in second.maps]
    wrong = replace(second, maps=away)
    stages = {id(run): stage_of(run) for run in (first, second)}
    reds = []
    for other in (second, wrong):
        maps = {"one": (first, stages[id(first)]), "two": (other, stages[id(second)])}
        film = Film(first, size=(320, 240), samples=0, maps=maps)
        reds.append(reddish(film.draw(film.timeline.end + 3.0)[:, -film._strip :]))
        film.close()
    assert reds[1] > reds[0]
