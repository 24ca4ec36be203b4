from dataclasses import replace

import numpy as np
import pytest
from drives import Holds

from lrf3d.base.errors import CollisionError, InputError, Lrf3dWarning, WorldError
from lrf3d.geometry.lines import lengths
from lrf3d.laser import LaserRangeFinder, imperfect
from lrf3d.scoring import buildings_seen, visible_walls
from lrf3d.simulation.live import LiveRobot
from lrf3d.simulation.scenario import Scenario, load_scenario, start_of
from lrf3d.simulation.tables import read_settings
from lrf3d.world import World

WALL = "[[object]]\npoints = [[0, 0], [4, 0]]\n"


def read(text, folder, settings=()):
    (folder / "w.toml").write_text(WALL + text)
    return load_scenario(folder / "w.toml", settings)


def test_a_file_of_walls_alone_gets_defaults(tmp_path):
    scenario = read("", tmp_path)
    assert scenario.name == "w"
    assert scenario.lrf.range_max == 80.0 and scenario.lrf.beams == 181
    assert scenario.sigmas == (0.04,)
    assert scenario.route is None and scenario.poses is None and scenario.start is None
    assert (scenario.speed, scenario.scan_interval, scenario.radius) == (3.0, 0.25, 0.35)
    assert dict(scenario.mapper) == {}


def test_a_file_that_is_no_text_is_a_world_error_that_names_it_once(tmp_path):
    (tmp_path / "w.toml").write_bytes(b'name = "a"\nx = "\xff"\n')
    with pytest.raises(WorldError, match=r"^[^ ]*w\.toml:2: not a text file in UTF-8$"):
        load_scenario(tmp_path / "w.toml")


ROOM = """
[robot]
start = [1, 2, 90]
route = [[1, 5], [3, 5]]
speed = 1.5
scan_interval = 0.1
radius = 0.2
[laser]
angle_min_deg = -90
angle_max_deg = 180.0
beams = 541
range_min = 0.1
range_max = 30
height = 0.3
scan_duration = 0.1
[noise]
sigma = [0.1, 0.2]
constant = 0.02
resolution = 0.01
drop_outs = 0.1
[mapper]
mode = "paper"
min_points = 5
merge_distance = 0.3
[film]
view = "top"
playback = 2
[[obstacle]]
route = [[5, 4], [9, 4]]
speed = 1.5
radius = 0.3
"""


def test_every_table_reaches_the_scenario_with_angles_in_radians(tmp_path):
    scenario = read(ROOM, tmp_path)
    assert scenario.start == (1.0, 2.0, np.pi / 2)
    assert scenario.route.tolist() == [[1, 2], [1, 5], [3, 5]]
    assert (scenario.speed, scenario.scan_interval, scenario.radius) == (1.5, 0.1, 0.2)
    angles = {"angle_min": -np.pi / 2, "angle_max": np.pi, "beams": 541}
    near = {"range_min": 0.1, "height": 0.3, "scan_duration": 0.1}
    assert scenario.lrf == LaserRangeFinder(**angles, **near, range_max=30.0)
    assert scenario.sigmas == (0.1, 0.2)
    assert scenario.noise == imperfect(0.1, constant=0.02, resolution=0.01, drop_outs=0.1)
    assert dict(scenario.mapper) == {"mode": "paper", "min_points": 5, "merge_distance": 0.3}
    assert (scenario.film.view, scenario.film.playback) == ("top", 2.0)
    (obstacle,) = scenario.obstacles
    assert np.hypot(*obstacle.outline.T).min() >= 0.3
    assert obstacle.path.at(np.array([1.0]))[0] == pytest.approx([6.5, 4, 0])


def test_settings_hold_instead_of_what_the_file_says(tmp_path):
    settings = ["laser.range_max=12", "noise.resolution=0.0", "noise.sigma=[0.01, 0.02]"]
    scenario = read(ROOM, tmp_path, settings)
    assert scenario.lrf.range_max == 12.0 and scenario.lrf.beams == 541
    assert scenario.noise == imperfect(0.01, constant=0.02, drop_outs=0.1)
    assert scenario.sigmas == (0.01, 0.02)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("laser.range_mx=2", "did you mean 'range_max'"),
        ("noise.dropouts=0.1", "did you mean 'drop_outs'"),
        ("range_max=2", "TABLE.KEY=VALUE"),
        ("robot.route=[[1, 2], [3", "not a TOML value; expected one such as 20"),
        ("laser.beams=5\nrange_max=1", "whole number"),
        ("mapper.mode=papr", "expected one of paper, robust, found 'papr'"),
        ("laser." + "a" * 1_000_000 + "=1", "known are"),
    ],
)
def test_an_invalid_setting_is_reported_with_what_is_expected(text, said):
    with pytest.raises(InputError, match="setting") as error:
        read_settings([text])
    assert said in str(error.value) and "\n" not in str(error.value)
    assert len(str(error.value)) < 1000


def test_a_text_needs_no_quotes_and_a_number_no_leading_nought():
    texts = ["mapper.mode=paper", "noise.sigma=.04", 'film.view="front door"', "robot.speed=2."]
    assert read_settings(texts) == {
        "mapper": {"mode": "paper"},
        "noise": {"sigma": 0.04},
        "film": {"view": "front door"},
        "robot": {"speed": 2.0},
    }
    assert read_settings(["film.view=front door"])["film"]["view"] == "front door"


def test_a_route_without_a_start_begins_at_its_first_way_point(tmp_path):
    scenario = read("[robot]\nroute = [[0, 1], [0, 5]]\n", tmp_path)
    assert scenario.start == (0.0, 1.0, np.pi / 2)
    assert scenario.route is not None
    assert scenario.start == start_of(scenario.route)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "[robot]\nroute = [[0, 1], [0, 5]]\nposes = [[0, 0, 0]]\n",
            "w.toml: robot.poses: stand next to a route",
        ),
        ("[film]\nview = 'x'\n", "w.toml: film: view: there is no 'x'; known are chase, first"),
        ("[laser]\nrange_min = 3\nrange_max = 2\n", "w.toml: laser: range finder: range_min 3"),
        (
            "[laser]\nangle_min_deg = 90\nangle_max_deg = 0\n",
            "w.toml: laser: .*angle_min 1.57.*up to angle_max",
        ),
    ],
)
def test_what_does_not_go_together_is_refused_with_its_line(text, message, tmp_path):
    with pytest.raises(WorldError, match=message):
        read(text, tmp_path)


@pytest.mark.parametrize("interval", [0.05, 2.3, 10.0])
def test_the_scan_interval_does_not_change_the_path(interval):
    corridor = load_scenario("corridor")
    seldom = replace(corridor, scan_interval=interval).trajectory()
    step = interval / max(1, round(interval / 0.05))
    way = replace(corridor, scan_interval=step).trajectory()
    assert (seldom.poses[:-1] == way.poses[:-1][:: round(interval / step)]).all()
    assert (seldom.poses[-1] == way.poses[-1]).all()
    assert seldom.times == pytest.approx(
        np.minimum(np.arange(len(seldom)) * interval, way.times[-1])
    )


def test_a_wall_between_two_scans_is_touched():
    wall = World(np.array([[5.0, -1.0, 5.0, 1.0]]))
    around = np.array([[0.0, 0.0], [5.0, 6.0], [10.0, 0.0]])
    scenario = Scenario(wall, start=start_of(around), route=around, speed=1.0, scan_interval=60.0)
    assert len(scenario.trajectory()) == 2
    with pytest.raises(CollisionError, match="wall 0"):
        replace(scenario, route=np.array([[0.0, 0.0], [5.0, 0.5], [10.0, 0.0]])).trajectory()


def test_the_city_is_that_of_the_paper_and_its_buildings_are_seen_from_all_sides():
    city = load_scenario("city")
    assert city.lrf.range_max == 80.0 and city.sigmas == (0.04,)
    assert city.world.object_count >= 40
    assert (np.bincount(city.world.objects) == 4).all()
    assert len(np.unique(city.world.heights)) > 15
    run = city.run(rng=0, snapshots=1, caster="planar")
    assert run.trajectory.length >= 200.0
    # The others are the horizon, beyond the outer streets.
    assert buildings_seen(run).seen_on_all_sides >= 40


def test_the_paper_room_shows_six_walls_of_g3_from_three_poses():
    room = load_scenario("paper_room")
    assert room.world.object_names == ("G1", "G2", "G3")
    assert np.bincount(room.world.objects)[2] == 6
    assert room.lrf.range_max == 14.0
    assert room.sigmas == (0.07, 0.42, 0.63)
    assert room.poses is not None and len(room.poses) == 3
    parts, walls = visible_walls(room.run(sigma=0.0, caster="planar"))
    shares = lengths(parts) / lengths(room.world.segments[walls])
    assert (shares[room.world.objects[walls] == 2] > 0.7).sum() == 6 and shares.mean() > 0.8


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        (["laser.angle_max_deg=1.5708"], "angle 1.5708 is read as degrees; for radians write 90"),
        (["laser.angle_min_deg=-2", "laser.angle_max_deg=2"], "read as degrees, are a field of 4°"),
        (["laser.angle_min_deg=-90", "laser.angle_max_deg=300"], "are a field of 390°"),
        (["laser.mount=[0.2, 0, 3.1416]"], "heading 3.1416 is read as degrees"),
    ],
)
def test_angles_in_the_wrong_unit_are_warned_of(settings, said, tmp_path):
    with pytest.warns(Lrf3dWarning, match=said):
        read("", tmp_path, settings)


def test_angles_of_real_lasers_are_not_warned_of(tmp_path):
    for most in (180, 135, 120.5, 360):
        read("", tmp_path, ["laser.angle_min_deg=0", f"laser.angle_max_deg={most}"])
    LaserRangeFinder(angle_min=-np.pi, angle_max=np.pi)
    LaserRangeFinder(angle_min=-0.05, angle_max=0.05)


def test_a_fan_of_degrees_is_warned_of():
    with pytest.warns(Lrf3dWarning, match=r"field of 5157°; for degrees write math.radians\(45\)"):
        LaserRangeFinder(angle_min=-45, angle_max=45)


@pytest.mark.parametrize(
    ("drive", "command", "end"),
    [
        ([], (1.0, 0.0), (1.0, 0.0, 0.0)),
        (["drive.kind=differential", "drive.track=0.5"], (1.0, 1.0), (1.0, 0.0, 0.0)),
        (["drive.kind=ackermann", "drive.wheelbase=2"], (1.0, np.arctan(2)), (0.959, 0.245, 0.5)),
        (["drive.kind=omni"], (0.0, 1.0, 0.0), (0.0, 1.0, 0.0)),
    ],
)
def test_the_drive_of_a_file_obeys_the_commands_of_its_kind(drive, command, end, tmp_path):
    scenario = read("[robot]\nstart = [0, 5, 0]\n", tmp_path, [*drive, "robot.scan_interval=1"])
    run = scenario.run(drive=Holds(*command), scans=2)
    assert run.trajectory.poses[1] == pytest.approx(np.array([0, 5, 0]) + end, abs=1e-3)


def test_a_live_robot_does_what_its_drive_can(tmp_path):
    for kind, end in (("unicycle", (0, 5, 1)), ("ackermann", (0, 5, 0)), ("omni", (1, 6, 0))):
        robot = LiveRobot(read("[robot]\nstart = [0, 5, 0]\n", tmp_path, [f"drive.kind={kind}"]))
        robot.drive(1.0, float(kind == "omni"), float(kind != "omni"), sideways=1.0)
        assert robot.pose == pytest.approx(end, abs=1e-9)
