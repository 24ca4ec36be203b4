"""What lidars hit is drawn: on walls and floor, by height, in films, pages and GLB files."""

import numpy as np
import pytest

import lrf3d
from lrf3d.studio.gltf import run_glb
from lrf3d.studio.scene.camera import Look
from lrf3d.studio.scene.clouds import HEIGHT_COLOURS, draw_clouds
from lrf3d.studio.scene.moments import Scene
from lrf3d.studio.scene.panel import panel
from lrf3d.studio.scene.timeline import Timeline


@pytest.fixture(scope="module")
def run():
    box = lrf3d.World([[0, 0, 9, 0], [9, 0, 9, 7], [9, 7, 0, 7], [0, 7, 0, 0]])
    drive = lrf3d.drive((2, 3, 0), 2.0, 0.5, duration=0.8)
    lidar = lrf3d.Lidar(np.linspace(-0.4, 0.4, 9), columns=90, mount=(0, 0, 0.5), scan_duration=0.1)
    tilted = lrf3d.Lidar([0.0], columns=40, mount=(0, 0, 0.5, 0, 0.3, 0), name="tilted")
    return lrf3d.simulate(box, drive, rng=0, lidars=[lidar, tilted])


def test_points_lie_where_each_column_of_a_driving_lidar_met_walls_and_floor(run):
    origin = np.array([1.0, 2.0])
    scans, _ = run.clouds(2)
    points = draw_clouds(scans, origin, 10_000, np.inf)
    x, y, z = np.add(points.places, [*origin, 0.0]).T
    off = np.abs([x, x - 9, y, y - 7, z]).min(axis=0)
    assert len(off) > 500 and off.max() < 1e-5
    floor = np.abs(z) < 1e-6
    assert np.allclose(points.colours[floor, :3], HEIGHT_COLOURS[0])
    lit = draw_clouds(run.clouds(2)[0], origin, 10_000, np.inf, "intensity")
    assert np.array_equal(lit.places, points.places)
    assert not np.allclose(lit.colours[floor, :3], HEIGHT_COLOURS[0])
    scans, _ = run.clouds(2)
    few = draw_clouds(scans, origin, 200, 0.8)
    assert 0 < len(few.places) < 400 and few.places[:, 2].max() < 0.8


def test_scenes_and_glb_files_show_clouds_only_of_robots_with_a_lidar(run):
    plain = lrf3d.simulate(run.world, run.trajectory, rng=0)
    assert len(run_glb(run)) > len(run_glb(plain)) + 50_000
    for each, there in ((run, True), (plain, False)):
        scene = Scene(Timeline(each))
        view = Look(np.array([0, 0, 9.0]), np.zeros(3), 1.0, (0.0, 1.0, 0.0))
        moment = scene.timeline.moment(0.5)
        marks = dict(scene.seen(moment, view, (64, 36)).marks)
        text = panel(each, moment, view, 1.0).text
        assert ("clouds" in marks) == ("━ points of a lidar" in text) == there


def test_hits_of_a_tilted_laser_are_drawn_where_they_are():
    walls = lrf3d.World([[4, -9, 4, 9], [-4, -9, -4, 9]], heights=[9.0, 9.0])
    drive = [(0.5, 1, 0.3), (0.6, 1, 0.3)]
    lrf = lrf3d.LaserRangeFinder(beams=37, mount=(0.2, 0.1, 0.5))
    run = lrf3d.simulate(walls, drive, lrf, attitude=lrf3d.Attitude(0.2, -0.1))
    scene = Scene(Timeline(run))
    lines, points, _ = scene._beams_at(scene.timeline.moment(0.0))
    x, _, z = np.add(points.places, [*scene.origin, 0.0]).T
    assert len(z) > 20 and np.ptp(z) > 0.4
    assert np.minimum(np.abs(z), np.abs(np.abs(x) - 4)).max() < 1e-5
    ends = np.concatenate([lines.ends, points.places])
    assert np.linalg.matrix_rank(ends - ends[0], tol=1e-4) == 2
