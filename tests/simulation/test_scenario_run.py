"""What Scenario.run and simulate give is what ``lrf3d run`` gives."""

import numpy as np
import pytest
from program import lrf3d as program
from stops import record_up_to
from test_cli import ROOM

import lrf3d
from lrf3d.laser import Chain, ConstantNoise, Quantised
from lrf3d.laser.noise import FLOOR

OBSTACLE = "[[obstacle]]\nroute = [[2.0, 2.0], [6.0, 2.0]]\nspeed = 0.7\n"


def same(one, other):
    """Whether two runs hold the same numbers, bit for bit."""
    assert len(one) == len(other) and one.film == other.film
    for name in ("ranges", "truth", "walls"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    np.testing.assert_array_equal(one.trajectory.poses, other.trajectory.poses)
    assert one.snapshot_scans == other.snapshot_scans
    for mine, theirs in zip(one.maps, other.maps, strict=True):
        np.testing.assert_array_equal(mine.segments, theirs.segments)
        np.testing.assert_array_equal(mine.objects, theirs.objects)


@pytest.mark.parametrize("world", ["room", "city"])
def test_a_scenario_runs_as_the_command_line_does(world, written, tmp_path):
    if world == "room":
        world = written("room.toml", ROOM + OBSTACLE)
    program("run", world, "--seed", 5, "--scans", 12, "--no-video", "--out", tmp_path / "out")
    there = lrf3d.load_run(tmp_path / "out/run.npz")
    scenario = lrf3d.load_scenario(world)
    same(scenario.run(rng=5, scans=12), there)
    same(lrf3d.simulate(scenario, rng=5, scans=12), there)


@pytest.mark.slow
def test_a_recording_of_the_command_line_goes_on_in_python(tmp_path):
    scenario = lrf3d.load_scenario("paper_room")
    program("run", "paper_room", "--no-video", "--out", tmp_path / "out")
    path = tmp_path / "out/run.npz"
    whole, written = path.read_bytes(), path.stat().st_mtime_ns
    # A finished run is the same one: it is neither refused nor written anew.
    lrf3d.record(scenario.simulation(rng=0), path, resume=True)
    assert path.stat().st_mtime_ns == written
    (tmp_path / "part").mkdir()
    record_up_to(2, scenario.simulation(rng=0), tmp_path / "part/run.npz")
    program("run", "paper_room", "--resume", "--no-video", "--out", tmp_path / "part")
    assert (tmp_path / "part/run.npz").read_bytes() == whole


def test_the_default_mapper_is_set_up_for_the_noise_that_is_given():
    room = lrf3d.load_world("paper_room")

    def mapper(noise):
        return repr(lrf3d.Simulation(room, [(1, 1, 0)], noise=noise).mapper)

    assert "sigma=0.63" in mapper(lrf3d.ProportionalNoise(0.63))
    assert "sigma=0.0," in mapper(None)
    chain = Chain([ConstantNoise(0.03), lrf3d.ProportionalNoise(0.3), Quantised(0.01)])
    assert f"sigma=0.3, floor={np.hypot(FLOOR, 0.03)}" in mapper(chain)
    # A noise of the user's that does not say how it scatters.
    assert mapper(lambda scan, rng: scan) == repr(lrf3d.LineMapper())
    assert mapper(Chain([lrf3d.ProportionalNoise(0.3), lambda scan, rng: scan])) == repr(
        lrf3d.LineMapper()
    )


def test_changes_hold_for_one_run():
    city = lrf3d.load_scenario("city")
    drive = [(50.0, 31.0, 0.0), (51.0, 31.0, 0.0)]
    run = city.run(drive=drive, lrf=lrf3d.LaserRangeFinder(beams=61), mode="paper", rng=0)
    assert run.lrf.beams == 61 and len(run) == 2 and city.lrf.beams == 181
    there = city.simulation(route=[[50, 31], [60, 31]], speed=2.0, scans=5, sigma=0.2)
    assert there.drive.poses[0].tolist() == [50.0, 31.0, 0.0]
    assert "sigma=0.2" in repr(there.mapper)
    assert "merge_length=0.3" in repr(
        city.simulation(drive=drive, mapper={"merge_length": 0.3}).mapper
    )
    with pytest.raises(lrf3d.InputError, match="no 'sped'; did you mean 'speed'"):
        city.run(sped=2.0)
    with pytest.raises(lrf3d.InputError, match="expected one of embree, planar"):
        city.run(drive=drive, caster="radar")


def test_the_version_is_that_of_the_package():
    assert program("--version").stdout == f"lrf3d {lrf3d.__version__}\n"
