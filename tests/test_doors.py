"""What is given to a function of the package in a wrong kind is refused by name, in one line."""

import pickle

import numpy as np
import pytest

import lrf3d


class Odd:
    def __repr__(self):
        raise RuntimeError


WRONG = [
    None,
    True,
    7,
    float("nan"),
    b"x",
    [],
    [1],
    {"a": 1},
    np.zeros((2, 3)),
    np.array("a"),
    Odd(),
]

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
    "load_map": lambda run, wrong: lrf3d.load_map(wrong),
    "load_run": lambda run, wrong: lrf3d.load_run(wrong),
    "load_log": lambda run, wrong: lrf3d.load_log(wrong),
    "largest_range": lambda run, wrong: lrf3d.load_log("a.log", largest_range=wrong),
    "export_run": lambda run, wrong: lrf3d.export_run(wrong, "carmen", "a.log"),
    "export_run to": lambda run, wrong: lrf3d.export_run(run, wrong, "a.log"),
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
    "sweep": lambda run, wrong: lrf3d.sweep("paper_room", axes=wrong, seeds=0),
    "mappers": lambda run, wrong: lrf3d.sweep("paper_room", mappers=wrong, seeds=0),
}

FITS = {
    "at": list,
    "LaserScan": int,
    **dict.fromkeys(("caster", "noises", "largest_range"), type(None)),
}


@pytest.mark.parametrize("door", DOORS)
def test_a_thing_of_the_wrong_kind_is_one_line(door, run, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for wrong in WRONG:
        if type(wrong) is not FITS.get(door):
            with pytest.raises(lrf3d.Lrf3dError) as caught:
                DOORS[door](run, wrong)
            assert "\n" not in str(caught.value) and not list(tmp_path.iterdir())


@pytest.mark.parametrize("kind", [lrf3d.PlanarCaster, lrf3d.EmbreeCaster])
def test_a_caster_can_be_pickled(kind):
    caster, lrf = kind(ROOM), lrf3d.LaserRangeFinder(beams=31)
    before = caster.cast(lrf, (1, 1, 0)).ranges
    assert (pickle.loads(pickle.dumps(caster)).cast(lrf, (1, 1, 0)).ranges == before).all()
