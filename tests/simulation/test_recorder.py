"""A loop of one's own becomes a run."""

import numpy as np
import pytest

import lrf3d

ROOM = lrf3d.load_world("paper_room")
LRF = lrf3d.LaserRangeFinder(beams=91, range_max=20.0)
DRIVE = lrf3d.follow_route([[1, 1], [3, 1]], speed=1.0)


def recorded(**extra):
    caster, mapper = lrf3d.PlanarCaster(ROOM), lrf3d.LineMapper(sigma=0.0)
    recorder = lrf3d.Recorder(ROOM, LRF)
    for pose in DRIVE.poses:
        scan = caster.cast(LRF, pose)
        mapper.update(scan)
        recorder.add(scan, map=mapper.map, **extra)
    return recorder


def test_a_recorder_gives_the_run_of_the_same_simulation(tmp_path):
    run = recorded().run()
    same = lrf3d.simulate(ROOM, DRIVE, LRF, caster="planar", mapper=lrf3d.LineMapper(sigma=0.0))
    assert np.array_equal(run.ranges, same.ranges) and np.array_equal(run.walls, same.walls)
    assert np.array_equal(run.trajectory.poses, same.trajectory.poses)
    assert np.array_equal(run.map.segments, same.map.segments)
    assert lrf3d.score_run(run) == lrf3d.score_run(same)
    lrf3d.save_run(run, tmp_path / "run.npz")
    assert len(lrf3d.load_run(tmp_path / "run.npz").maps) == len(run)


def test_light_and_motion_of_each_scan_are_kept():
    walls = [[6, -4, 6, 4], [6, 4, -3, 4], [-3, 4, -3, -4]]
    world = lrf3d.World(walls, range(3), materials=["glass", "plaster", "mirror"])
    lrf = lrf3d.LaserRangeFinder(beams=61, range_max=20.0, scan_duration=0.2, echoes=2)
    steps = lrf3d.Simulation(world, lrf3d.follow_route([[0, 0], [2, 1]]), lrf, rng=0)
    recorder = lrf3d.Recorder(world, lrf)
    for step in steps:
        recorder.add(step.scans, truth=step.true_scans, time=step.time)
    run, same = (
        recorder.run(),
        lrf3d.simulate(world, lrf3d.follow_route([[0, 0], [2, 1]]), lrf, rng=0),
    )
    assert run.motions[:, 0].any()
    for name in same.rows:
        assert np.array_equal(getattr(run, name), getattr(same, name), equal_nan=True)


def test_a_recorder_reports_what_it_cannot_keep():
    recorder = recorded(estimate=(0, 0, 0))
    assert recorder.run().estimate.poses.shape == (len(recorder), 3)
    scan = lrf3d.PlanarCaster(ROOM).cast(LRF, (1, 1, 0))
    for scans, values, said in (
        (scan, {}, "every scan or for none"),
        (scan, {"time": 0.0, "estimate": (0, 0, 0)}, "after"),
        ([scan, scan], {}, "expected a scan of"),
    ):
        with pytest.raises(lrf3d.InputError, match=said):
            recorder.add(scans, **values)
    with pytest.raises(lrf3d.InputError, match="no scans"):
        lrf3d.Recorder(ROOM, LRF).run()
