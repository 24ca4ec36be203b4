"""What is given to a function of the package in a wrong kind is refused by name, in one line."""

import pickle
import warnings
from contextlib import suppress
from inspect import signature
from pathlib import Path

import numpy as np
import pytest

import lrf3d
from lrf3d import plot, ros, scoring
from lrf3d.recordings import LaserLog


class Odd:
    def __repr__(self):
        raise RuntimeError


WRONG = [None, True, 7, np.nan, b"x", [], [1], {"a": 1}, np.zeros((2, 3)), np.array("a"), Odd()]

FLAT = Path(__file__).parents[1] / "examples" / "flat.png"
DRIVE = FLAT.with_name("drive.log.gz")
ROOM = lrf3d.World([[0, 0, 5, 0], [5, 0, 5, 4], [5, 4, 0, 4], [0, 4, 0, 0]])


@pytest.fixture(scope="module")
def run():
    return lrf3d.simulate(ROOM, [(1, 1, 0), (2, 1, 0)], rng=0)


DOORS = {
    "save_world": lambda run, wrong: lrf3d.save_world(wrong, "a.toml"),
    "save_world at": lambda run, wrong: lrf3d.save_world(ROOM, wrong),
    "save_map": lambda run, wrong: lrf3d.save_map(wrong, "a.geojson"),
    "save_run": lambda run, wrong: lrf3d.save_run(wrong, "a.npz"),
    "save_run at": lambda run, wrong: lrf3d.save_run(run, wrong),
    "load_world": lambda run, wrong: lrf3d.load_world(wrong),
    "resolution": lambda run, wrong: lrf3d.load_world(FLAT, resolution=wrong),
    "load_map": lambda run, wrong: lrf3d.load_map(wrong),
    "load_run": lambda run, wrong: lrf3d.load_run(wrong),
    "load_log": lambda run, wrong: lrf3d.load_log(wrong),
    "largest_range": lambda run, wrong: lrf3d.load_log("a.log", largest_range=wrong),
    "export_run": lambda run, wrong: lrf3d.export_run(wrong, "carmen", "a.log"),
    "export_run to": lambda run, wrong: lrf3d.export_run(run, wrong, "a.log"),
    "export_run every": lambda run, wrong: lrf3d.export_run(run, "carmen", "a.log", every=wrong),
    "record": lambda run, wrong: lrf3d.record(wrong, "a.npz"),
    "plan_route": lambda run, wrong: lrf3d.plan_route(wrong),
    "render_video": lambda run, wrong: lrf3d.render_video(wrong, "a.gif"),
    "render_video at": lambda run, wrong: lrf3d.render_video(run, wrong, renderer="embree"),
    "caster": lambda run, wrong: lrf3d.simulate(ROOM, [(1, 1, 0)], caster=wrong),
    "at": lambda run, wrong: run.trajectory.at(wrong),
    "LaserScan": lambda run, wrong: lrf3d.LaserScan((0, 0, 0), [0.0], [1.0], range_max=wrong),
    "LineMapper": lambda run, wrong: lrf3d.LineMapper(wrong),
    "noises": lambda run, wrong: lrf3d.simulate(ROOM, [(1, 1, 0)], noise=wrong),
    "noise": lambda run, wrong: lrf3d.ProportionalNoise(0.1)(wrong, 0),
    "Recorder": lambda run, wrong: lrf3d.Recorder(wrong, run.lrf),
    "recorded scan": lambda run, wrong: lrf3d.Recorder(ROOM, run.lrf).add(wrong),
    "recorded obstacles": lambda run, wrong: lrf3d.Recorder(ROOM, run.lrf, obstacles=wrong),
    "obstacles": lambda run, wrong: lrf3d.simulate(ROOM, [(1, 1, 0)], obstacles=wrong),
    "on_collision": lambda run, wrong: lrf3d.simulate(ROOM, [(1, 1, 0)], on_collision=wrong),
    "fleet's starts": lambda run, wrong: lrf3d.simulate_fleet(ROOM, [[(1, 1, 0)]], starts=wrong),
    "fleet's mapper": lambda run, wrong: lrf3d.simulate_fleet(ROOM, [[(1, 1, 0)]], mapper=wrong),
    "fleet's obstacles": lambda run, wrong: lrf3d.simulate_fleet(ROOM, [], obstacles=wrong),
    "WheelOdometry": lambda run, wrong: lrf3d.WheelOdometry(wrong),
    "increment": lambda run, wrong: lrf3d.WheelOdometry()(wrong, np.random.default_rng(0)),
    "wheels' rng": lambda run, wrong: lrf3d.WheelOdometry()((1, 0, 0), wrong),
    "Imu": lambda run, wrong: lrf3d.Imu(wrong),
    "DifferentialDrive": lambda run, wrong: lrf3d.DifferentialDrive(0.5).twist(wrong, 1.0),
    "AckermannDrive": lambda run, wrong: lrf3d.AckermannDrive(2.0).move((0, 0, 0), 1.0, wrong, 1.0),
    "OmniDrive": lambda run, wrong: lrf3d.OmniDrive().twist(wrong, 0.0, 0.0),
    "check_drive": lambda run, wrong: lrf3d.check_drive(wrong, ROOM, 0.1),
    "crosscheck": lambda run, wrong: lrf3d.crosscheck(ROOM, wrong, [(1, 1, 0)]),
    "score_run": lambda run, wrong: lrf3d.score_run(wrong),
    "score_map": lambda run, wrong: lrf3d.score_map(run.map, wrong, ROOM.objects),
    "score_map by": lambda run, wrong: lrf3d.score_map(run.map, ROOM.segments, wrong),
    "score_log": lambda run, wrong: scoring.score_log(run.map, wrong),
    "score_trajectory": lambda run, wrong: scoring.score_trajectory([(0, 0, 0)], wrong),
    "match_segments": lambda run, wrong: scoring.match_segments(ROOM.segments, wrong),
    "buildings_seen": lambda run, wrong: scoring.buildings_seen(wrong),
    "LineMap": lambda run, wrong: lrf3d.LineMap(wrong, [0], [9]),
    "slam_log": lambda run, wrong: lrf3d.slam_log(wrong),
    "serve": lambda run, wrong: ros.serve(wrong),
    "slam_log close": lambda run, wrong: lrf3d.slam_log(
        LaserLog("two", [*run.scans]), close=[wrong]
    ),
    "sweep's workers": lambda run, wrong: lrf3d.sweep("paper_room", seeds=1, workers=wrong),
    "sweep": lambda run, wrong: lrf3d.sweep("paper_room", axes=wrong, seeds=0),
    "mappers": lambda run, wrong: lrf3d.sweep("paper_room", mappers=wrong, seeds=0),
    "a mapper": lambda run, wrong: lrf3d.sweep("paper_room", mappers=[wrong]),
    "progress": lambda run, wrong: lrf3d.simulate(ROOM, [(1, 1, 0)], progress=wrong),
    "record's progress": lambda run, wrong: lrf3d.record(
        lrf3d.Simulation(ROOM, [(1, 1, 0)]), "a.npz", progress=wrong
    ),
    "fleet's progress": lambda run, wrong: lrf3d.simulate_fleet(ROOM, [], progress=wrong),
    "film's progress": lambda run, wrong: lrf3d.render_video(run, "a.gif", progress=wrong),
    "map_log's progress": lambda run, wrong: lrf3d.map_log("a.log", progress=wrong),
    "sweep's progress": lambda run, wrong: lrf3d.sweep("paper_room", progress=wrong),
    "masked": lambda run, wrong: lrf3d.World(np.ma.masked_array(ROOM.segments, ROOM.segments == 5)),
    "save_map free": lambda run, wrong: lrf3d.save_map(run.map, "a.geojson", free=wrong),
    "load_log format": lambda run, wrong: lrf3d.load_log(DRIVE, format=wrong),
    "load_log part": lambda run, wrong: lrf3d.load_log(DRIVE, part=wrong),
    "Scenario lrf": lambda run, wrong: lrf3d.Scenario(ROOM, lrf=wrong),
    "Scenario world": lambda run, wrong: lrf3d.load_scenario("paper_room").changed(world=wrong),
    "Scenario obstacles": lambda run, wrong: lrf3d.Scenario(ROOM, obstacles=wrong),
    "settings": lambda run, wrong: lrf3d.load_scenario("paper_room", wrong),
    "Run.scan": lambda run, wrong: run.scan(wrong),
    "Run.part": lambda run, wrong: run.part(wrong),
    "Run.map_after": lambda run, wrong: run.map_after(wrong),
    "executor": lambda run, wrong: lrf3d.sweep("paper_room", seeds=1, executor=wrong),
    "directions": lambda run, wrong: run.lrf.directions(wrong),
    "Simulation film": lambda run, wrong: lrf3d.Simulation(ROOM, [(1, 1, 0)], film=wrong),
    "odometry": lambda run, wrong: lrf3d.Simulation(ROOM, [(1, 1, 0)], odometry=wrong),
    "plot.world poses": lambda run, wrong: plot.world(ROOM, poses=wrong),
    "plot.scan lrf": lambda run, wrong: plot.scan(run.scan(0), lrf=wrong),
    "plot ax": lambda run, wrong: plot.map(run.map, wrong),
    "Pose @": lambda run, wrong: lrf3d.Pose(0, 0, 0) @ wrong,
    "Pose.apply": lambda run, wrong: lrf3d.Pose(0, 0, 0).apply(wrong),
    "visible_walls": lambda run, wrong: scoring.visible_walls(run, wrong),
    "labels": lambda run, wrong: scoring.adjusted_rand_index(wrong, [1, 2]),
    "crosscheck's progress": lambda run, wrong: lrf3d.crosscheck(
        ROOM, run.lrf, [(1, 1, 0)], progress=wrong
    ),
}

FITS = {
    "export_run every": (int,),
    "sweep's workers": (int, type(None)),
    "at": (list,),
    "LaserScan": (int,),
    **dict.fromkeys(("caster", "noises", "largest_range", "on_collision"), (type(None),)),
    **dict.fromkeys(("fleet's starts", "fleet's mapper"), (type(None),)),
    **dict.fromkeys(("recorded obstacles", "fleet's obstacles", "score_log"), (list,)),
    "obstacles": (list, type(None)),
    **dict.fromkeys(("Scenario obstacles", "settings", "Run.part"), (list,)),
    **dict.fromkeys(("save_map free", "load_log format", "odometry"), (type(None),)),
    **dict.fromkeys(("plot.scan lrf", "plot ax"), (type(None),)),
    "plot.world poses": (np.ndarray, type(None)),
    "load_log part": (type(None),),
    "Run.map_after": (int,),
    "executor": (type(None),),
    "Pose.apply": (np.ndarray,),
    "visible_walls": (int,),
    "resolution": (int,),
    **dict.fromkeys(("WheelOdometry", "DifferentialDrive", "AckermannDrive"), (int, bool)),
    "OmniDrive": (int, bool),
    "Imu": (int,),
}


@pytest.mark.parametrize("door", DOORS)
def test_a_thing_of_the_wrong_kind_is_one_line(door, run, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for wrong in WRONG:
        if type(wrong) not in FITS.get(door, ()):
            with pytest.raises(lrf3d.Lrf3dError) as caught:
                DOORS[door](run, wrong)
            assert "\n" not in str(caught.value) and not list(tmp_path.iterdir())


PUBLIC = {
    f"{room.__name__}.{name}": getattr(room, name)
    for room in (lrf3d, plot, scoring)
    for name in room.__all__
}

STRANGE = [
    *WRONG, -3, 10**400, 1e300, "word", np.zeros((0, 3)), np.full((2, 3), np.nan),
    np.ma.masked_array(np.ones((2, 3)), [[0, 1, 0]] * 2),
]  # fmt: skip


def required(thing):
    """The arguments by position that something public needs, one at least, and those by name."""
    parameters = signature(thing).parameters.values()
    placed = [each for each in parameters if each.kind in (each.POSITIONAL_OR_KEYWORD,)]
    needs = [each for each in placed if each.default is each.empty]
    named = [each.name for each in parameters if each.kind is each.KEYWORD_ONLY and
             each.default is each.empty]  # fmt: skip
    return max(len(needs), min(1, len(placed))), named


@pytest.mark.parametrize("name", PUBLIC)
def test_whatever_a_public_name_gets_its_error_is_one_of_ours(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    thing = PUBLIC[name]
    if not callable(thing) or (isinstance(thing, type) and issubclass(thing, Exception)):
        return
    count, named = required(thing)
    for strange in STRANGE:
        with warnings.catch_warnings(), suppress(lrf3d.Lrf3dError):
            warnings.simplefilter("ignore")
            thing(*[strange] * count, **dict.fromkeys(named, strange))


@pytest.mark.parametrize("kind", [lrf3d.PlanarCaster, lrf3d.EmbreeCaster])
def test_a_caster_can_be_pickled(kind):
    caster, lrf = kind(ROOM), lrf3d.LaserRangeFinder(beams=31)
    before = caster.cast(lrf, (1, 1, 0)).ranges
    assert (pickle.loads(pickle.dumps(caster)).cast(lrf, (1, 1, 0)).ranges == before).all()
