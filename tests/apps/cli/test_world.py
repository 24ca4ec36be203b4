import json
from argparse import Namespace

import numpy as np
import pytest
from program import lrf3d, ran, refused, told

from lrf3d import load_run, load_world
from lrf3d.apps.cli import inputs
from lrf3d.plans import reading as plans
from lrf3d.simulation.scenario import read_scenario_file, scenario_of


def test_a_generated_world_goes_through_every_format(tmp_path):
    told("world", "generate", "rooms", "--seed", 2, "--size", 16, "--out", tmp_path / "a.toml")
    walls = {}
    for source, target in (("a.toml", "b.geojson"), ("b.geojson", "c.glb"), ("c.glb", "d.yaml")):
        report = told("world", "convert", tmp_path / source, tmp_path / target, warns=True)
        walls[target] = report["walls"]
        assert report["written"] == str(tmp_path / target)
    assert walls["b.geojson"] == walls["c.glb"] == walls["d.yaml"] > 20
    picture = tmp_path / "d.png"
    shown = told("world", "show", tmp_path / "d.yaml", "--out", picture)
    assert shown["walls"] == pytest.approx(walls["d.yaml"], rel=0.2)
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_scale_and_resolution_are_what_is_written(tmp_path):
    path = tmp_path / "room.yaml"
    done = told("world", "convert", "paper_room", path, "--scale", 0.5, "--resolution", 0.1)
    (_, _), (x2, y2) = done["bounds_m"]
    assert {"city", "paper_room"} <= {*told("world", "show")}
    plain = told("world", "show", "paper_room")["bounds_m"]
    assert [x2, y2] == pytest.approx([0.5 * plain[1][0], 0.5 * plain[1][1]])
    assert "resolution: 0.1" in path.read_text()


@pytest.mark.slow
def test_a_map_becomes_a_world_that_is_driven_inside_its_free_space(tmp_path):
    office = tmp_path / "office.toml"
    ran("world", "generate", "rooms", "--seed", 2, "--size", 12, "--out", office)
    quiet = ("--no-video", "--json")
    ran("run", office, *quiet, "--out", tmp_path / "first")
    mapped, rooms = tmp_path / "first" / "map.geojson", tmp_path / "rooms.toml"
    ran("world", "convert", mapped, rooms)
    for world in (mapped, rooms):
        second = ran("run", world, *quiet, "--out", tmp_path / "second", "--force")
        assert "in the cells that the map shows to be free" in second.stderr
        run = load_run(tmp_path / "second")
        assert load_world(world).free.contain(run.trajectory.poses[:, :2]).mean() > 0.95
        assert json.loads(second.stdout)["score"]["length_f1"] > 0.95
        # It sees the rooms that the first drive saw, not the outside.
        known, again = load_run(tmp_path / "first").free_cells(), run.free_cells()
        assert again.cells.sum() > 0.7 * known.cells.sum()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["convert", "city", "city.xyz"], "lrf3d: city.xyz: unknown ending"),
        (["convert", "city", "city.toml", "--resolution", 1], "for a ROS map"),
        (["convert", "city", "city.toml", "--scale", 0], "scale 0.0: expected"),
        (["generate", "maze", "--size", 2, "--out", "m.toml"], "size 2 m"),
        (["generate", "maze", "--out", "/proc/none/m.toml"], "cannot be written"),
    ],
)
def test_what_cannot_be_done_is_one_line(arguments, said):
    assert said in refused("world", *arguments)


DRAWING = """\
<svg xmlns="http://www.w3.org/2000/svg" width="120mm" height="90mm" viewBox="0 0 120 90">
<path d="M 10 10 H 60 M 70 10 H 110 V 80 H 10 V 10" fill="none" stroke="black"/></svg>"""


@pytest.mark.slow
def test_a_drawing_on_paper_is_warned_of_and_enlarged(written):
    plan = written("plan.svg", DRAWING)
    small = ran("world", "show", plan)
    assert small.stderr.count("\n") == 1
    assert "0.1 m by 0.07 m" in small.stderr and "--scale 100" in small.stderr
    large = lrf3d("world", "show", plan, "--scale", 100)
    assert large.stderr == "" and "bounds     x 1.00 to 11.00 m, y 1.00 to 8.00 m" in large.stdout
    huge = lrf3d("world", "show", plan, "--scale", 100_000)
    assert "10,000 m by 7,000 m" in huge.stderr and "--scale 100 " in huge.stderr


def test_the_chosen_side_of_the_walls_is_reported(written, tmp_path):
    plan = written("plan.svg", DRAWING)
    arguments = ["run", plan, "--scale", 100, "--no-video", "--scans", 2, "--out", tmp_path / "out"]
    done = lrf3d(*arguments, "--json")
    said = "_plan: the route is planned inside the walls; --outside plans it outside\n"
    assert done.stderr.endswith(said) and done.stderr.count("\n") == 1
    assert json.loads(done.stdout)["planned"] == "inside"
    assert "nearer to a wall" in refused(*arguments, "--set", "robot.start=[10.9, 2, 0]")
    assert "has its own route" in refused("run", "city", "--inside")
    assert "choose one" in refused("run", "city", "--inside", "--outside")


def test_scale_enlarges_the_way_through_a_world_too(written):
    path = written(
        "room.toml",
        "[[object]]\npoints = [[0, 0], [4, 0], [4, 4]]\n[robot]\nstart = [1, 3, 90]\n"
        "route = [[1, 3], [2, 3]]\n[[obstacle]]\nroute = [[0, 3], [1, 3]]\n",
    )
    scenario = scenario_of(read_scenario_file(path).scaled(2.0))
    assert tuple(scenario.start) == (2.0, 6.0, np.pi / 2)
    assert scenario.route.tolist() == [[2.0, 6.0], [4.0, 6.0]]
    assert scenario.obstacles[0].path.route.tolist() == [[0.0, 6.0], [2.0, 6.0]]
    assert scenario.world.bounds.tolist() == [[0.0, 0.0], [8.0, 8.0]]


def test_trees_are_shown_as_they_are_converted(tmp_path):
    places = [(0, 0), (1e-4, 0), (1e-4, 1e-4), (0, 1e-4), (1e-3, 0)]
    nodes = "".join(f'<node id="{k}" lon="{x}" lat="{y}"/>' for k, (x, y) in enumerate(places))
    house = "".join(f'<nd ref="{k}"/>' for k in (0, 1, 2, 3, 0))
    (tmp_path / "a.osm").write_text(
        f"<osm>{nodes[:-2]}><tag k='natural' v='tree'/></node>"
        f"<way id='1'>{house}<tag k='building' v='yes'/></way></osm>"
    )
    for command in (["show"], ["convert", tmp_path / "a.toml"]):
        words = ["world", command[0], tmp_path / "a.osm", *command[1:]]
        for more, objects in ([], 1), (["--trees"], 2):
            assert told(*words, *more, warns=True)["objects"] == objects
    assert refused("world", "show", tmp_path / "a.toml", "--trees")


def test_a_drawing_is_read_once_to_be_shown(written, monkeypatch):
    path = written("a.svg", '<svg width="9m" height="9m"><path d="M0 0h450v450"/></svg>')
    read, seen = plans.plan_of_file, []
    monkeypatch.setattr(plans, "plan_of_file", lambda *a, **o: seen.append(a) or read(*a, **o))
    scenario, shown = inputs.read_shown(Namespace(command="world show", world=str(path)))
    assert len(seen) == 1 and len(scenario.world.segments) == len(shown.segments) > 0
