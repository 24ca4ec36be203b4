"""Lidars and depth cameras on a drive: what a step measures, a run casts again."""

import re
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from drives import Holds

import lrf3d
from lrf3d.laser import Chain, ConstantNoise, DropOuts
from lrf3d.messages import clouds

SCENE = """
[[object]]
points = [[0, 0], [9, 0], [9, 7], [0, 7]]
closed = true
[[object]]
points = [[5, 4], [6, 4], [6, 5], [5, 5]]
closed = true
height = 0.3
[robot]
route = [[1, 1], [4, 1], [4, 2]]
[[obstacle]]
route = [[7, 2], [7, 5]]
[[lidar]]
preset = "OS1-32"
columns = 64
mount = [0.1, 0, 0.6]
[[depth_camera]]
width = 16
height = 12
fov_deg = 70
mount = [0.2, 0, 0.5, 90, 10, 0]
"""


@pytest.fixture
def scene(written) -> lrf3d.Scenario:
    path = written("scene.toml", SCENE)
    return lrf3d.load_scenario(path)


# A wall ahead, higher than any beam.
ROOM = lrf3d.World([[9, -50, 9, 50]], heights=[50.0])


def test_a_run_casts_again_what_its_steps_measured(scene: Any, tmp_path: Path) -> None:
    noise = Chain([DropOuts(0.05), ConstantNoise(0.01)])
    measured = [
        (step.lidar_scans[0], step.depth_images[0]) for step in scene.simulation(rng=3, noise=noise)
    ]
    lrf3d.save_run(scene.run(rng=3, noise=noise), tmp_path / "run.npz")
    again = lrf3d.load_run(tmp_path / "run.npz")
    assert again.sweeps is not None and np.abs(again.sweeps).max() > 0.05
    for index, (scan, image) in enumerate(measured):
        assert again.lidar(index).ranges.tobytes() == scan.ranges.tobytes()
        assert again.depth(index).depth.tobytes() == image.depth.tobytes()
    true = again.lidar(4, noisy=False)
    kept = measured[4][0].hits
    assert 0.0 < np.abs(true.ranges[kept] - measured[4][0].ranges[kept]).max() < 0.1
    assert again.part(np.array([4])).lidar(0).ranges.tobytes() == measured[4][0].ranges.tobytes()


def test_scans_of_lasers_do_not_depend_on_lidars(scene: Any) -> None:
    alone = scene.run(rng=1, lidars=(), depth_cameras=())
    assert np.array_equal(alone.ranges, scene.run(rng=1).ranges)


def test_a_rolling_lidar_sees_walls_from_where_each_column_was(scene: Any) -> None:
    scan = scene.run(rng=1, sigma=0.0).lidar(1)
    assert scan.motion is not None and scan.motion[0] > 0.05 and not scan.motion[1:].any()
    lrf = scan.lidar.planar
    moved = scan.motion[0] * np.linspace(0.0, 1.0, lrf.beams)
    ahead = np.abs(lrf.angles) < 0.3
    high = scan.walls == 1
    rows = high & ahead
    x = scan.pose.x + moved + scan.ranges / scan.lidar.stretches[:, None] * np.cos(lrf.angles)
    assert rows.any()
    np.testing.assert_allclose(x[rows], 9.0, atol=1e-9)


@pytest.mark.parametrize("to", ["ply", "pcd", "las", "kitti", "npz"])
def test_clouds_are_written_for_other_programs(scene: Any, tmp_path: Path, to: str) -> None:
    run = scene.run(rng=0, scans=3)
    if to == "las":
        laspy = pytest.importorskip("laspy")
    path = tmp_path / {"kitti": "sequence"}.get(to, f"points.{to}")
    lrf3d.export_run(run, to, path)
    counts = [int(scan.hits.sum()) for scan in run.lidar_scans]
    world = np.concatenate([scan.points() for scan in run.lidar_scans])
    if to == "npz":
        assert np.diff(np.load(path)["starts"]).tolist() == counts
        return
    if to == "kitti":
        scans = [np.fromfile(each, "<f4") for each in sorted((path / "velodyne").iterdir())]
        poses = np.loadtxt(path / "poses.txt").reshape(-1, 3, 4)
        found = np.concatenate(
            [
                points.reshape(-1, 4)[:, :3] @ pose[:, :3].T + pose[:, 3]
                for points, pose in zip(scans, poses, strict=True)
            ]
        )
    elif to == "las":
        found = np.asarray(laspy.read(path).xyz)
    else:
        data = path.read_bytes()
        end = b"DATA binary\n" if to == "pcd" else b"end_header\n"
        head, _, body = data.partition(end)
        assert f" {sum(counts)} ".encode() in head
        rows = np.frombuffer(body, f"<f4,<f4,<f4,<f4,{'<i4' if to == 'ply' else '<u2'},<f4")
        found = np.column_stack([rows[f"f{k}"] for k in range(3)])
    np.testing.assert_allclose(found, world, atol=1e-4 if to != "las" else 1e-3)


def test_intensities_are_those_of_range_finders() -> None:
    walls = [[3, -9, 3, 9], [-2, -9, -2, 9], [-9, 4, 9, 5], [1, -3, 2, -3]]
    materials = ["metal", "brick", "glass", "mirror"]
    caster = lrf3d.EmbreeCaster(lrf3d.World(walls, range(4), materials=materials))
    lidar = lrf3d.Lidar([-0.8, 0.0, 0.1], columns=90)
    pose = (0.1, 0.2, 0.3)
    scan = caster.cast_lidar(lidar, pose)
    flat = caster.cast(lidar.planar, pose)
    np.testing.assert_array_equal(scan.intensities[1], flat.intensities)
    lit = caster.light_layers(lidar.planar, pose, [0.1])
    both = scan.hits[2] & np.isfinite(lit.ranges[0])
    np.testing.assert_allclose(scan.intensities[2, both], lit.intensities[0, both], rtol=1e-9)
    # The floor is of plaster, and 0.8 is its share.
    down = scan.walls[0] < 0
    assert down.any() and np.isfinite(scan.ranges[0]).all()
    assert scan.intensities[0, down].max() == pytest.approx(0.8 * np.sin(0.8) ** 3 / 0.5**2)


def test_a_rosette_fills_its_field_of_view_over_time() -> None:
    lidar = lrf3d.Lidar.preset("Mid-40", name="ahead", mount=(0, 0, 10, 0, 0.2, 0))
    run = lrf3d.simulate(ROOM, [(0, 0, 0), (0, 0, 0)], lidars=lidar, rng=0)
    first, second = run.lidar_scans
    ways = first.lidar.directions((0, 0, 0))[0]
    axis = [np.cos(0.2), 0.0, -np.sin(0.2)]
    assert np.degrees(np.arccos(ways @ axis).max()) == pytest.approx(19.2, abs=0.01)
    np.testing.assert_allclose(first.points()[:, 0], 9.0, atol=1e-9)
    assert np.abs(first.points() - second.points()).max() > 1.0


def test_a_run_without_a_lidar_has_no_clouds(tmp_path: Path) -> None:
    run = lrf3d.load_scenario("paper_room").run(rng=0)
    with pytest.raises(lrf3d.InputError, match="no lidar"):
        lrf3d.export_run(run, "ply", tmp_path / "points.ply")
    with pytest.raises(lrf3d.InputError, match="0 lidars"):
        run.lidar(0)
    with pytest.raises(lrf3d.InputError, match="scan 9: expected"):
        lrf3d.simulate(ROOM, [(0, 0, 0)], lidars=lrf3d.Lidar([0.0])).lidar(9)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"OS1-32"', '"OS1-23"', "did you mean 'OS1-32'"),
        ("[0.1, 0, 0.6]", "[0.1, 0, -0.6]", "below the floor"),
        ("width = 16\n", "", "expected a width"),
        ('preset = "OS1-32"\n', "", "expected a preset or elevations_deg"),
    ],
)
def test_wrong_tables_are_one_line(written, old: str, new: str, message: str) -> None:
    path = written("scene.toml", SCENE.replace(old, new, 1))
    with pytest.raises(lrf3d.InputError, match=message):
        lrf3d.load_scenario(path)


def test_clouds_go_into_bags_and_live_topics(scene: Any, tmp_path: Path) -> None:
    from rosbags.highlevel import AnyReader

    from lrf3d.ros.stream import Settings, Stream

    run = scene.run(rng=0, scans=2)
    lrf3d.export_run(run, "rosbag2", tmp_path / "bag")
    found: dict[str, Any] = {}
    with AnyReader([tmp_path / "bag"]) as reader:
        for connection, _, data in reader.messages():
            found.setdefault(connection.topic, reader.deserialize(data, connection.msgtype))
    cloud = found["/lidar/points"]
    rows = np.frombuffer(cloud.data.tobytes(), clouds.POINT)
    scan = run.lidar(0)
    assert cloud.width == len(rows) == scan.hits.sum()
    np.testing.assert_array_equal(rows["ring"], scan.rings)
    depth = found["/camera/depth/image_raw"].data.view("<f4").reshape(12, 16)
    np.testing.assert_allclose(depth, run.depth(0).depth, rtol=1e-6)
    stream = Stream(scene, Settings(), say=lambda level, text: None)
    sent = {topic.name: fields for topic, fields in [*stream.first(), *stream.tick()]}
    assert {topic.name for topic in stream.topics} >= set(sent)
    assert sent["lidar/points"]["width"] == stream.robots[0].robot.clouds()[0].__next__().hits.sum()
    frames = {each["child_frame_id"] for each in sent["tf_static"]["transforms"]}
    assert frames == {"base_footprint", "laser", "lidar", "camera", "camera_optical"}


def test_settings_change_the_lidars_of_a_world_or_give_it_one(written) -> None:
    file = written("yard.toml", SCENE)
    before = lrf3d.load_scenario(file)
    found = lrf3d.load_scenario(file, ["lidar.columns=7", "depth_camera.width=9"])
    assert [each.columns for each in found.lidars] == [7] * len(before.lidars)
    assert [each.width for each in found.depth_cameras] == [9] * len(before.depth_cameras)
    (given,) = lrf3d.load_scenario("paper_room", ["lidar.preset=VLP-16"]).lidars
    assert given.columns == 1800
    for setting in ("lidar.columns=9", "depth_camera.width=9", "lidar.colums=9"):
        with pytest.raises(lrf3d.InputError, match=r"expected a|did you mean"):
            lrf3d.load_scenario("paper_room", [setting])


@pytest.mark.parametrize("controlled", [False, True])
def test_lidars_of_a_fleet_see_the_other_robots(controlled: bool) -> None:
    starts = [(0, 0, 0), (3, 0, 0)]
    drives = [Holds(0.0, 0.0)] * 2 if controlled else [[start] for start in starts]
    lidar = lrf3d.Lidar([0.0, 0.5], columns=8, mount=(0, 0, 0.1))
    world = lrf3d.World([[9, -9, 9, 9]])
    more = {"scans": 2} if controlled else {}
    runs = lrf3d.simulate_fleet(world, drives, starts=starts, rng=0, lidars=lidar, **more)
    first, second = (run.lidar(0).ranges[:, 4] for run in runs)
    assert first[0] < 3.0 and second.round(6)[0] == 6.0 and first[1] > 9.0


@pytest.mark.parametrize(("x", "arm"), [(2.1, 0.0), (1.8, 0.3), (1.8, 0.9), (2.0, 0.0)])
def test_a_lidar_in_or_behind_a_wall_is_one_line(x: float, arm: float) -> None:
    wall = lrf3d.World([[2, 0, 2.2, 0], [2.2, 0, 2.2, 5], [2.2, 5, 2, 5], [2, 5, 2, 0]], [0] * 4)
    drive = [(0, 2, 0), (x, 2, 0)]
    for z, where in (0.5, f"at 1 s it is in or behind a wall, at ({x + arm:.2f}, 2.00)"), (2.6, ""):
        lidar = lrf3d.Lidar([0.0], columns=4, mount=(arm, 0, z))
        with pytest.raises(lrf3d.InputError, match=re.escape(where)) if where else nullcontext():
            lrf3d.Simulation(wall, drive, lidars=lidar)
    lrf3d.Simulation(wall, drive, lidars=lidar, on_collision="ignore")
