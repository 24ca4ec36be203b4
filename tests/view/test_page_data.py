"""What the page gets of a run."""

from dataclasses import replace

import numpy as np
import pytest
from test_glb import FAR
from test_render import city_run

from lrf3d.casting.dynamic_obstacle import DynamicObstacle, round_outline
from lrf3d.laser import LaserRangeFinder
from lrf3d.robot import Trajectory
from lrf3d.scenario import load_scenario
from lrf3d.view.page_data import pack_run


def unpacked(run):
    block, told = pack_run(run)
    return {
        name: np.frombuffer(block, kind, length, begin)
        for name, (kind, begin, length) in told["layout"].items()
    }


@pytest.mark.parametrize("offset", [(0.0, 0.0), FAR])
def test_the_page_gets_the_run_as_it_is(offset):
    run = city_run(offset)
    arrays = unpacked(run)
    shift = np.array([*run.world.origin, 0.0])
    poses = arrays["poses"].reshape(-1, 3) + shift
    assert poses == pytest.approx(run.trajectory.poses, abs=1e-4)
    assert arrays["ranges"].reshape(run.ranges.shape) == pytest.approx(run.ranges, rel=1e-6)
    segments = arrays["segments"].reshape(-1, 4) + np.tile(run.world.origin, 2)
    assert segments == pytest.approx(run.map.segments, abs=1e-4)
    assert arrays["stageSizes"].tolist() == [len(run.map)]
    assert len(arrays["colours"]) == 3 * len(run.map)


def test_the_page_gets_what_moved_beside_the_robot():
    way = Trajectory([0.5, 2.0], [(-22, 1, 3.0), (-14, -1, -3.0)])
    obstacles = (
        DynamicObstacle(round_outline(0.4), way),
        DynamicObstacle(round_outline(0.3), Trajectory([0], [(1, 2, 3)])),
    )
    run = replace(city_run(), obstacles=obstacles)
    arrays = unpacked(run)
    times, poses = arrays["obstacleTimes"], arrays["obstaclePoses"].reshape(-1, 3)
    shift = np.array([*run.world.origin, 0.0])
    for obstacle, end in zip(obstacles, np.cumsum(arrays["obstacleSizes"]), strict=True):
        first = end - arrays["obstacleSizes"][obstacles.index(obstacle)]
        due = obstacle.path.at(times[first:end] + run.trajectory.times[0])
        assert poses[first:end, :2] + shift[:2] == pytest.approx(due[:, :2], abs=1e-4)
        # From key to key it turns the shorter way.
        assert np.abs(np.diff(poses[first:end, 2])).max() < np.pi


def test_a_run_without_a_map_is_shown():
    arrays = unpacked(replace(city_run(), snapshot_scans=(), maps=()))
    assert len(arrays["segments"]) == len(arrays["stageTimes"]) == 0


def test_a_range_finder_of_one_beam_is_played():
    run = city_run()
    lrf = LaserRangeFinder(angle_min=0.0, angle_max=0.0, beams=1, range_max=run.lrf.range_max)
    middle = slice(45, 46)
    ranges, walls = run.ranges[:, middle], run.walls[:, middle]
    arrays = unpacked(replace(run, lrf=lrf, ranges=ranges, truth=ranges, walls=walls))
    assert len(arrays["joined"]) == 0 and len(arrays["ranges"]) == len(run)


def test_points_of_a_run_have_the_darkness_of_their_light_if_asked():
    office = load_scenario("glass_office")
    run = office.run(rng=0, scans=4)
    assert "darkness" not in unpacked(run)
    dark = unpacked(replace(run, film=replace(run.film, points_by="intensity")))["darkness"]
    shares = dark.reshape(run.ranges.shape) / 255.0
    lights = run.intensities
    assert (shares[lights >= 1.0] == 0.0).all() and (shares[lights <= 1e-4] == 1.0).all()
    between = (lights > 1e-4) & (lights < 1.0)
    want = -np.log10(lights[between]) / 4.0
    assert np.abs(shares[between] - want).max() <= 0.5 / 255.0 + 1e-9
