"""What the page is sent: the scene's arrays, once each."""

import json
from dataclasses import replace

import numpy as np
import pytest
from estimates import estimated
from test_render import city_run
from yard import OBSTACLE, YARD

from lrf3d.casting.dynamic_obstacle import DynamicObstacle, round_outline
from lrf3d.laser import LaserRangeFinder
from lrf3d.pose import Pose
from lrf3d.robot import Trajectory
from lrf3d.scenario import load_scenario
from lrf3d.scene.shapes import Lines, Points, Soft
from lrf3d.scene.stage import stage_of
from lrf3d.view.hand_drive import HandDrive, Wish
from lrf3d.view.message import Sender
from lrf3d.view.shown import VIEWS, Driven, Played, Wanted

FAR = (85_000.0, 447_500.0)
TYPES = {"f4": np.float32, "u1": np.uint8}


def read(message):
    """A message's header, its arrays in the place of their descriptions."""
    length = int.from_bytes(message[:4], "little")
    header, block = json.loads(message[4 : 4 + length]), message[4 + length :]
    for told in header.get("marks", {}).values():
        for name, (kind, first, count, size) in (told or {}).get("columns", {}).items():
            array = np.frombuffer(block, TYPES[kind], count, first)
            told["columns"][name] = array.reshape(-1, size)
    return header


def lines(width=2.0):
    ends = np.arange(6, dtype=np.float32).reshape(2, 3)
    sides, opacities = np.zeros((2, 2), np.float32), np.array([[1, 0], [0.5, 2]], np.float32)
    return Lines(ends, ends + 1, ends / 5, opacities, sides, width)


def test_arrays_are_sent_once_and_marks_that_go_are_named():
    sender = Sender()
    mark = lines()
    header = read(sender.message({"a": mark, "b": mark}, {"words": {"t": "1"}}))
    assert header["words"] == {"t": "1"}
    first = header["marks"]["a"]
    assert (first["kind"], first["width"]) == ("lines", 2.0)
    assert np.array_equal(first["columns"]["start"], mark.starts)
    assert first["columns"]["last"][:, 3].tolist() == [0, 255]
    assert header["marks"]["b"]["as"] == "a" and "columns" not in header["marks"]["b"]
    assert sender.message({"a": mark, "b": mark}, {"words": {"t": "1"}}) is None
    changed = mark._replace(opacities=mark.opacities.copy())
    header = read(sender.message({"a": changed}, {"words": {"t": "1"}}))
    assert set(header) == {"marks"} and header["marks"]["b"] is None
    assert set(header["marks"]["a"]["columns"]) == {"first", "last"}
    # One that comes again is sent as a whole.
    header = read(sender.message({"a": changed, "b": lines(3.0)}, {}))
    assert len(header["marks"]["b"]["columns"]) == 5


@pytest.mark.parametrize("offset", [(0.0, 0.0), FAR])
def test_a_page_gets_the_scene_of_the_film(offset):
    run = city_run(offset)
    played = Played(run, stage_of(run), 1.0)
    header = read(played.answer(Wanted(time=2.0), 0.0))
    marks = header["marks"]
    assert {"trail", "fan", "beams", "points", "map", "plan robot"} <= set(marks)
    assert marks["plan points"]["as"] == "points"
    scan = run.scan(int(np.searchsorted(run.trajectory.times, 2.0 + 1e-9, side="right")) - 1)
    places = marks["points"]["columns"]["position"][:, :2] + run.world.origin
    assert places == pytest.approx(scan.points(), abs=1e-4)
    pose = run.trajectory.at(np.array([2.0]))[0]
    assert header["bodies"]["robot"][12:14] == pytest.approx(pose[:2] - run.world.origin, abs=1e-4)
    assert header["words"]["x"] == f"{pose[0]:.2f}"
    assert f" / {run.lrf.beams} beams hit" in header["words"]["beams"]


def test_every_view_is_looked_through_and_nothing_comes_where_nothing_changes():
    run = city_run()
    played = Played(run, stage_of(run), 1.0)
    for view in VIEWS:
        wanted = Wanted(view=view, time=1.0)
        header = read(played.answer(wanted, 0.0))
        assert header["camera"]["view"] == view
        assert played.answer(wanted, 0.0) is None
    story = Wanted(view="story", time=1e6)
    camera = read(played.answer(story, 0.0))["camera"]
    assert camera["ghost"] == 1.0
    by_hand = read(played.answer(Wanted(view="orbit", eye=(1.0, 2.0, 30.0)), 0.0))["camera"]
    assert by_hand["eye"] == [1.0, 2.0, 30.0]


def test_a_page_gets_what_moved_and_what_the_robot_believed():
    way = Trajectory([0.5, 2.0], [(-22, 1, 3.0), (-14, -1, -3.0)])
    run = replace(estimated(city_run()), obstacles=(DynamicObstacle(round_outline(0.4), way),))
    header = read(Played(run, stage_of(run), 1.0).answer(Wanted(time=1.0), 0.0))
    place = header["bodies"]["obstacle 0"][12:14]
    assert place == pytest.approx(way.at(np.array([1.0]))[0, :2] - run.world.origin, abs=1e-4)
    assert {"estimate", "ellipses", "shadows"} <= set(header["marks"])
    assert header["words"]["truth"] == "truth"
    assert header["words"]["believed"].startswith("estimate, 95 % ")


def test_runs_without_a_map_or_of_one_beam_are_shown():
    run = city_run()
    lrf = LaserRangeFinder(angle_min=0.0, angle_max=0.0, beams=1, range_max=run.lrf.range_max)
    middle = slice(45, 46)
    ranges, walls = run.ranges[:, middle], run.walls[:, middle]
    single = replace(run, lrf=lrf, ranges=ranges, truth=ranges, walls=walls)
    bare = replace(run, snapshot_scans=(), maps=())
    for each in (single, bare):
        assert read(Played(each, stage_of(each), 1.0).answer(Wanted(), 0.0))["marks"]
    assert "no map yet" in json.dumps(
        read(Played(bare, stage_of(bare), 1.0).answer(Wanted(), 0.0))["words"]
    )


def test_points_and_glow_are_bytes():
    places, sides = np.zeros((1, 3), np.float32), np.zeros((1, 2), np.float32)
    points = Points(places, np.full((1, 4), 0.5, np.float32), sides, 0.1, (2.0, 4.0))
    soft = Soft(np.zeros((1, 3, 3), np.float32), np.full((1, 3, 4), 2.0, np.float32))
    marks = read(Sender().message({"points": points, "soft": soft}, {}))["marks"]
    assert marks["points"]["columns"]["tint"].tolist() == [[128] * 4]
    assert marks["soft"]["columns"]["tint"].tolist() == [[255] * 4] * 3


@pytest.fixture
def driven(tmp_path):
    def make(text):
        (tmp_path / "world.toml").write_text(text)
        scenario = load_scenario(tmp_path / "world.toml")
        return Driven(HandDrive(scenario, Pose(2.0, 3.0, 0.0)))

    return make


def test_a_drive_sends_nothing_while_nothing_changes(driven):
    page = driven(YARD)
    header = read(page.answer(Wanted(), 0.05))
    assert {"fan", "points", "map", "trail"} <= set(header["marks"])
    assert [page.answer(Wanted(), 0.05) for _ in range(3)] == [None] * 3
    turning = read(page.answer(Wanted(wish=Wish(0.0, 1.0)), 0.05))
    # The robot turns on the spot, and so do its beams.
    assert {"robot"} <= set(turning["bodies"]) and "points" in turning["marks"]
    for _ in range(20):
        page.answer(Wanted(wish=Wish(1.0, 0.0)), 0.05)
    last = read(page.answer(Wanted(wish=Wish(1.0, 0.0)), 0.05))
    assert len(last["marks"]["trail"]["columns"]["start"]) > 10
    assert last["words"]["v"] == "2.00"


def test_a_drive_shows_what_moves(driven):
    page = driven(YARD + OBSTACLE)
    before = read(page.answer(Wanted(), 0.05))["bodies"]["obstacle 0"]
    after = read(page.answer(Wanted(), 0.05))["bodies"]["obstacle 0"]
    assert before != after


@pytest.mark.parametrize(
    "sent",
    [
        *(None, 1, "drive", [], [1, 0], {}, {"forward": 1}, {"forward": None, "turn": 0}),
        *({"forward": value, "turn": 0} for value in ("1", float("nan"), 10**400, 2, [0])),
        *({"time": "1"}, {"time": float("nan")}, {"view": "nowhere"}, {"view": ["top"]}),
        *({"eye": [1, 2]}, {"eye": [1, 2, "3"]}, {"aspect": 0}, {"aspect": -1e300}),
    ],
)
def test_what_is_malformed_is_ignored(sent):
    assert Wanted().changed(sent) == Wanted()


def test_a_wish_is_two_numbers():
    assert Wanted().changed({"forward": 1, "turn": -0.5}).wish == Wish(1.0, -0.5)
