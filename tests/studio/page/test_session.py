"""What the page is sent: the scene's arrays, once each."""

import gc
import json
from dataclasses import replace

import numpy as np
import pytest
from estimates import estimated
from test_glb import one_beam_run
from test_render import city_run
from yard import OBSTACLE, YARD, hand

from lrf3d import DynamicObstacle, Trajectory, load_scenario
from lrf3d.casting.dynamic_obstacle import round_outline
from lrf3d.studio.page.message import Sender, part_of, stage_message
from lrf3d.studio.page.server import world_view
from lrf3d.studio.page.session import PageSession, Wanted
from lrf3d.studio.scene.shapes import Lines, Points, Soft
from lrf3d.studio.scene.stage.stage import stage_of

FAR = (85_000.0, 447_500.0)


def read(message):
    """A message's header, its arrays in the place of where they lie."""
    length = int.from_bytes(message[:4], "little")
    header, block = json.loads(message[4 : 4 + length]), message[4 + length :]
    for mark in header.get("marks", {}).values():
        sent, mark["columns"], mark["first"] = mark["columns"], {}, {}
        for place, start, size, first, rows in sent:
            kind, values = ("f4", size) if size else ("u1", 4)
            count = (rows - first) * values
            mark["columns"][place] = np.frombuffer(block, kind, count, start).reshape(-1, values)
            mark["first"][place] = first
    return header


def lines(width=2.0):
    ends = np.arange(6, dtype=np.float32).reshape(2, 3)
    opacities = np.array([[1, 0], [0.5, 2]], np.float32)
    return Lines(ends, ends + 1, ends / 5, opacities, width)


def test_arrays_are_sent_once_and_colours_are_bytes():
    places, sides = np.zeros((1, 3), np.float32), np.zeros((1, 2), np.float32)
    points = Points(places, np.full((1, 4), 0.5, np.float32), sides, 0.1, (2.0, 4.0))
    soft = Soft(np.zeros((1, 3, 3), np.float32), np.full((1, 3, 4), 2.0, np.float32))
    marks, sender = {"lines": lines(), "points": points, "soft": soft}, Sender()
    parts = {name: part_of(mark) for name, mark in marks.items()}
    header = read(sender.message(parts, {"words": {"t": "1"}}))
    assert header["words"] == {"t": "1"}
    first = header["marks"]["lines"]
    assert (first["kind"], first["width"], first["thick"]) == ("lines", 2.0, 0.0)
    for place, values in enumerate(lines()[:2]):
        assert np.array_equal(first["columns"][place], values)
    assert first["columns"][3].tolist() == [[1, 0], [0.5, 2]]
    assert header["marks"]["points"]["columns"][1].tolist() == [[128] * 4]
    assert header["marks"]["soft"]["columns"][1].tolist() == [[255] * 4] * 3
    again = read(sender.message(parts, {}))["marks"]
    assert [each["columns"] for each in again.values()] == [{}, {}, {}]
    paler = part_of(points._replace(colours=points.colours / 2))
    header = read(sender.message({**parts, "points": paler}, {}))
    assert not header["marks"]["lines"]["columns"]
    assert set(header["marks"]["points"]["columns"]) == {1}
    # What the plan shares with the scene is sent once.
    plan = part_of(points._replace(glows=False))
    twice = {**parts, "plan points": plan, "plan lines": parts["lines"]}
    message = Sender().message(twice, {})
    sent = read(message)["marks"]
    assert len(message) - int.from_bytes(message[:4], "little") == 4 + sum(
        column.nbytes for name in marks for column in sent[name]["columns"].values()
    )
    assert np.array_equal(sent["plan lines"]["columns"][0], first["columns"][0])


def test_of_an_array_that_has_grown_only_what_is_new_is_sent():
    sender, places = Sender(), np.arange(18.0, dtype=np.float32).reshape(6, 3)
    sides, colours = np.zeros((6, 2), np.float32), np.ones((6, 4), np.float32)

    def sent(rows):
        points = Points(places[:rows].copy(), colours[:rows], sides[:rows], 0.1, (2.0, 4.0))
        return read(sender.message({"points": part_of(points)}, {}))["marks"]["points"]

    assert len(sent(4)["columns"][0]) == 4
    grown = sent(6)
    assert np.array_equal(grown["columns"][0], places[4:]) and grown["first"][0] == 4
    assert len(sent(3)["columns"][0]) == 0
    places[1] += 1.0
    assert np.array_equal(sent(3)["columns"][0], places[1:3])


@pytest.mark.parametrize("offset", [(0.0, 0.0), FAR])
def test_a_page_gets_the_scene_of_the_film(offset):
    run = city_run(offset)
    header = read(PageSession.played(run, 1.0).answer(Wanted(time=2.0), 0.0))
    marks = header["marks"]
    assert {"trail", "beams", "points", "bands", "robot", "plan robot"} <= set(marks)
    scan = run.scan(int(np.searchsorted(run.trajectory.times, 2.0 + 1e-9, side="right")) - 1)
    places = marks["points"]["columns"][0][:, :2] + run.world.origin
    assert places == pytest.approx(scan.points(), abs=1e-4)
    pose = run.trajectory.at(np.array([2.0]))[0]
    assert marks["robot"]["pose"][12:14] == pytest.approx(pose[:2] - run.world.origin, abs=1e-4)
    assert header["words"]["x"] == f"{pose[0]:.2f}"
    assert f" / {run.lrf.beams} beams hit" in header["words"]["beams"]


def test_what_stands_is_sent_with_the_shaders_of_the_film():
    stage = stage_of(city_run())
    marks = read(stage_message(stage))
    assert len(marks["marks"]["walls"]["columns"][0]) == 6 * len(stage.faces.places)
    assert all("void main" in each for pair in marks["programs"].values() for each in pair)
    # In the coarse depths of large triangles, what lies on the ground would sink.
    ground = marks["marks"]["ground"]["columns"][0].reshape(-1, 3, 2)
    assert np.median(np.ptp(ground, axis=1)) < 0.2 * stage.ground.size.max()


def test_every_view_is_sent_and_an_unchanged_one_is_not():
    run = city_run()
    played, eyes = PageSession.played(run, 1.0), []
    views = ("story", "follow", "orbit", "top", "first")
    for view in views:
        wanted = Wanted(view=view, time=1.0)
        eyes.append(read(played.answer(wanted, 0.0))["camera"]["eye"])
        assert played.answer(wanted, 0.0) is None
    assert len(set(map(tuple, eyes))) == len(views)
    assert read(played.answer(Wanted(view="story", time=1e6), 0.0))["camera"]["dusk"] == 1.0


def test_a_page_gets_obstacles_and_the_estimate():
    way = Trajectory([0.5, 2.0], [(-22, 1, 3.0), (-14, -1, -3.0)])
    run = replace(estimated(city_run()), obstacles=(DynamicObstacle(round_outline(0.4), way),))
    header = read(PageSession.played(run, 1.0).answer(Wanted(time=1.0), 0.0))
    place = header["marks"]["obstacle 0"]["pose"][12:14]
    assert place == pytest.approx(way.at(np.array([1.0]))[0, :2] - run.world.origin, abs=1e-4)
    assert {"estimate", "ellipses", "shadows"} <= set(header["marks"])
    assert header["words"]["truth"] == "truth"
    assert header["words"]["believed"].startswith("estimate, ellipses of 95 % ")


def test_runs_without_a_map_or_of_one_beam_are_shown():
    runs = one_beam_run(), replace(city_run(), snapshot_scans=(), maps=())
    shown = [read(PageSession.played(run, 1.0).answer(Wanted(), 0.0)) for run in runs]
    assert all(each["marks"] for each in shown)
    assert shown[1]["words"]["map"] == "no map yet"


def test_a_drive_sends_nothing_while_nothing_changes(tmp_path):
    page = PageSession.driven(hand(YARD, tmp_path))
    header = read(page.answer(Wanted(), 0.05))
    assert {"points", "bands", "trail"} <= set(header["marks"])
    assert [page.answer(Wanted(), 0.05) for _ in range(3)] == [None] * 3
    turning = read(page.answer(Wanted(turn=1.0), 0.05))
    # The robot turns on the spot, and so do its beams.
    assert {"robot", "points"} <= set(turning["marks"])


@pytest.mark.slow
def test_of_a_long_trail_only_its_end_is_sent(tmp_path):
    page, wanted, trail = (
        PageSession.driven(hand(YARD, tmp_path)),
        Wanted(forward=0.8, turn=0.9),
        [],
    )
    for _ in range(300):
        header = read(page.answer(wanted, 1.0 / 30.0))
        drawn = header["marks"]["trail"]
        trail[drawn["first"][1] :] = ends = drawn["columns"][1].tolist()
        assert len(ends) < 3
    assert header["words"]["v"] == "1.60"
    # Chords of a drive of 0.8 · 2 m/s.
    driven = np.hypot(*np.diff(np.array(trail)[:, :2], axis=0).T).sum()
    assert driven == pytest.approx(1.6 * 300 / 30, rel=0.06)


def test_a_drive_shows_what_moves(tmp_path):
    page = PageSession.driven(hand(YARD + OBSTACLE, tmp_path))
    before, after = (read(page.answer(Wanted(), 0.05))["marks"]["obstacle 0"] for _ in range(2))
    assert before["pose"] != after["pose"] and not after["columns"]


def test_a_robot_at_rest_shows_beams_that_end_at_what_moves(tmp_path):
    drive = hand(YARD + OBSTACLE, tmp_path)
    page = PageSession.driven(drive)
    for _ in range(5):
        marks = read(page.answer(Wanted(), 0.1))["marks"]
        (scan,) = drive.latest
        places = marks["points"]["columns"][0][:, :2] + page.scene.origin
        assert places == pytest.approx(scan.points(), abs=1e-4)


@pytest.mark.parametrize(
    "sent",
    [
        *("", "drive", "null", "1", '"drive"', "[]", "[1, 0]", "{}", '{"forward": null}'),
        *('{"forward": [0]}', '{"forward": NaN}', f'{{"turn": 1{"0" * 400}}}', '{"turn": 2}'),
        *('{"time": "now"}', '{"width": -1}'),
    ],
)
def test_malformed_messages_are_ignored(sent):
    assert Wanted().changed(sent) == Wanted()


def test_a_message_changes_what_is_wanted():
    sent = '{"view": "top", "forward": 1, "turn": -0.5}'
    assert Wanted(time=3.0).changed(sent) == Wanted("top", 3.0, forward=1.0, turn=-0.5)


def test_a_page_that_leaves_takes_its_memory_with_it():
    # What is in a cycle waits for the garbage collector, which many pages do not call.
    make = world_view(load_scenario("paper_room").with_route(), 0)
    make().answer(Wanted(forward=1.0), 0.03)
    gc.collect()
    make().answer(Wanted(forward=1.0), 0.03)
    assert gc.collect() == 0
