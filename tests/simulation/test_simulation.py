from dataclasses import replace

import numpy as np
import pytest

import lrf3d
from lrf3d import InputError, LaserRangeFinder, ProportionalNoise, World, load_run, simulate

ROOM = World(
    np.array([[0, 0, 10, 0], [10, 0, 10, 8], [10, 8, 0, 8], [0, 8, 0, 0.0]]),
    name="room",
    object_names=("walls",),
)
POSES = np.array([[2.0, 2.0, 0.1], [4.0, 3.0, 0.8], [5.0, 5.0, 2.0]])


def run_of(sigma=0.1, scan_duration=0.0, **settings):
    lrf = LaserRangeFinder(range_max=20.0, scan_duration=scan_duration)
    return simulate(ROOM, POSES, lrf, noise=ProportionalNoise(sigma), rng=3, **settings)


def test_a_run_holds_truth_measurement_and_map():
    run = run_of()
    assert len(run) == 3 and run.ranges.shape == run.truth.shape == (3, 181)
    assert 0.01 < (run.ranges - run.truth).std() < 0.1
    silent = run_of(sigma=0.0)
    assert np.array_equal(silent.ranges, silent.truth)
    assert [scan.time for scan in run.scans] == [0.0, 1.0, 2.0]
    assert run.true_scan(1).ranges == pytest.approx(run.truth[1])
    assert run.map is run.maps[-1] and run.snapshot_scans == (0, 1, 2)
    assert not any(numbers.flags.writeable for numbers in run.lasting_objects)
    assert len(run.map_after(-1)) == 0 and run.map_after(1) is run.maps[1]


def test_the_map_snapshots_of_a_long_run_are_few_and_end_with_the_last(monkeypatch):
    monkeypatch.setattr(lrf3d.simulation.run, "MAP_SNAPSHOTS", 7)
    poses = np.repeat(POSES[:1], 50, axis=0)
    run = simulate(ROOM, poses, LaserRangeFinder(beams=31, range_max=20.0))
    assert len(run.snapshot_scans) == 7 and run.snapshot_scans[-1] == 49
    one = run_of(snapshots=1)
    assert one.snapshot_scans == (2,) and len(one.maps) == 1
    assert np.array_equal(one.map.segments, run_of().map.segments)


def test_the_map_of_a_step_is_read_before_the_next_step():
    simulation = lrf3d.Simulation(ROOM, POSES, LaserRangeFinder(range_max=20.0))
    steps = []
    for step in simulation:
        assert len(step.map) > 0 and step.map is simulation.map
        steps.append(step)
    assert steps[-1].map is simulation.map
    with pytest.raises(InputError, match=r"map of step 0.*before the next step"):
        _ = steps[0].map


def test_a_run_is_written_and_read_back_to_the_last_bit(tmp_path):
    run = run_of(scan_duration=0.25)
    lrf3d.save_run(run, tmp_path / "run.npz")
    for path in (tmp_path / "run.npz", tmp_path):
        back = load_run(path)
        for name in ("ranges", "truth", "walls"):
            assert np.array_equal(getattr(back, name), getattr(run, name))
        assert np.array_equal(back.trajectory.poses, run.trajectory.poses)
        assert np.array_equal(back.world.segments, run.world.segments)
        assert back.world.name == "room" and back.world.object_names == ("walls",)
        assert back.lrf == run.lrf and back.snapshot_scans == run.snapshot_scans
        assert back.scan(1).time_increment == 0.25 / 180
        assert all(
            np.array_equal(a.segments, b.segments) and np.array_equal(a.objects, b.objects)
            for a, b in zip(back.maps, run.maps, strict=True)
        )


@pytest.fixture(scope="module")
def run():
    return run_of()


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        *(
            ("snapshot_scans", scans, "snapshot_scans")
            for scans in ((), (0, 1), (0, 1, 1), (2, 1, 0), (0, 1, 3), (-1, 0, 1), (0, 1, 1.5))
        ),
        ("intensities", np.ones((2, 181)), "intensities"),
        ("echoes", np.ones((3, 180, 2)), "echoes"),
        ("estimate", lrf3d.EstimatedTrajectory(np.zeros((2, 3))), "of 2 scans; expected 3"),
    ],
)
def test_snapshots_light_and_estimate_belong_to_the_scans_in_order(run, name, value, said):
    with pytest.raises(InputError, match=said):
        replace(run, **{name: value})


def test_a_seed_is_called_rng_and_a_name_is_no_world():
    with pytest.raises(InputError, match="there is no 'seed'; did you mean 'rng'"):
        lrf3d.load_scenario("paper_room").run(seed=1)
    with pytest.raises(InputError, match="there is no 'seed'; did you mean 'rng'"):
        simulate(ROOM, POSES, seed=1)
    with pytest.raises(InputError, match="simulate: 'corridor': expected a World or a Scenario"):
        simulate("corridor")


def test_a_simulation_is_built_with_the_radius_that_it_collides_with_and_its_film():
    box = [(-0.3, -0.4), (0.3, -0.4), (0.3, 0.4), (-0.3, 0.4)]
    lrf = LaserRangeFinder(beams=3)
    for checks in ("raise", "stop", "ignore"):
        made = lrf3d.Simulation(ROOM, POSES, lrf, outline=box, on_collision=checks)
        assert made.radius == pytest.approx(0.5)
    assert lrf3d.Simulation(ROOM, POSES, lrf, radius=0.7).radius == 0.7
    (run,) = lrf3d.simulate_fleet(ROOM, [POSES], lrf, outline=box)
    assert run.radius == pytest.approx(0.5)
    film = lrf3d.load_scenario("city").film
    assert simulate(ROOM, POSES, lrf, film=film).film is film
    scenario = lrf3d.load_scenario("paper_room").changed(outline=box, film=film)
    made = scenario.simulation()
    assert made.radius == scenario.radius and made.film is film
    # Poses outside of the room are driven to where collisions are ignored.
    through = np.vstack([POSES, POSES[0] + [9.0, 0.0, 0.0]])
    with pytest.raises(lrf3d.CollisionError):
        lrf3d.Simulation(ROOM, through, lrf, radius=0.5)
    assert list(lrf3d.Simulation(ROOM, through, lrf, radius=0.5, on_collision="ignore"))
