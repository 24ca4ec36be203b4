"""How large are the errors of lidar odometry, by the lidar's layers and its noise?

Lidars with the same field of view scan a drive in a built-in world. kiss-icp and small-gicp, where
installed, estimate the trajectory from the point clouds alone; wheels that slip are the baseline.
"""

import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from benchmarks.report import Figure, Report, Row, numbers
from lrf3d.casting import PlanarCaster
from lrf3d.geometry.lines import Float
from lrf3d.laser import Lidar
from lrf3d.robot import Trajectory
from lrf3d.robot.odometry import Odometer, WheelOdometry
from lrf3d.scoring.trajectory_score import pose_errors
from lrf3d.simulation.scenario import load_scenario

COLUMNS = 512
"""Columns of the lidars."""

STEEPEST = 22.5
"""Elevation of the outermost layers [°], as in an OS1."""

HEIGHT = 1.2
"""Height of the lidars above the floor [m]."""

SPEED = 4.0
"""Speed of the robot [m/s]: 0.4 m from one scan to the next."""

VOXEL = 1.0
"""Side of a voxel of small-gicp's map [m], the default of both libraries for such ranges."""

DOWNSAMPLING = 0.25
"""Side of a voxel in which small-gicp merges the points of a scan [m]."""

Locate = Callable[[Float], Float]
"""From the points (m, 3) of the next scan to the pose (4, 4) of the lidar, in the frame of the
first scan."""


def bench(
    world: Annotated[str, "A world."] = "city",
    *,
    layers: Annotated[str, "Numbers of layers."] = "8,16,32,64,128",
    noises: Annotated[str, "Standard deviations of the ranges [mm]."] = "0,20,50,100",
    scans: Annotated[int, "Scans of the drive, ten a second."] = 125,
    figure: Figure = None,
) -> Report:
    """Estimate a drive by lidar odometry, and score the trajectories."""
    report = Report(__doc__.splitlines()[0])
    truth = _drive(world, scans)
    caster = PlanarCaster(load_scenario(world).world)
    rng = np.random.default_rng(0)
    odometer = Odometer(WheelOdometry(), rng)
    wheels = np.array([odometer.drive(pose) for pose in truth.poses])
    report.add("wheels", drive_m=truth.length, ape_m=_off(truth, wheels))
    for count in numbers("--layers", layers):
        elevations = np.radians(np.linspace(-STEEPEST, STEEPEST, count))
        lidar = Lidar(elevations, columns=COLUMNS, mount=(0.0, 0.0, HEIGHT))
        true = [caster.cast_lidar(lidar, pose) for pose in truth.poses]
        for millimetres in numbers("--noises", noises, least=0):
            sigma = 1e-3 * millimetres
            measured = [replace(scan, ranges=rng.normal(scan.ranges, sigma)) for scan in true]
            for name, locate, floor in _odometries():
                clouds = [
                    scan.points(local=True)[floor | (scan.walls[scan.hits] >= 0)]
                    for scan in measured
                ]
                begin = time.process_time()
                poses = [locate(cloud) for cloud in clouds]
                spent = time.process_time() - begin
                report.add(
                    "trajectories", of=name, layers=count, noise_m=sigma,
                    ape_m=_off(truth, _planar(np.array(poses))), scan_s=spent / len(true),
                )  # fmt: skip
    if "trajectories" not in report.tables:
        report.notes.append("Not installed: kiss-icp, small-gicp.")
    elif figure is not None:
        _draw(report.tables["trajectories"], report.tables["wheels"][0], figure)
    return report


def _drive(world: str, scans: int) -> Trajectory:
    """The first scans of a drive along the route, ten a second."""
    changes = [f"robot.speed={SPEED}", "robot.scan_interval=0.1"]
    return load_scenario(world, changes).trajectory(scans=scans)


def _off(truth: Trajectory, poses: Float) -> float:
    """Absolute pose error after the best alignment, root mean square [m]."""
    errors = pose_errors(truth, Trajectory(truth.times, poses)).absolute
    return float(np.sqrt((errors**2).mean()))


def _planar(poses: Float) -> Float:
    """Poses (n, 3) x, y [m], theta [rad] of poses (n, 4, 4)."""
    heading = np.arctan2(poses[:, 1, 0], poses[:, 0, 0])
    return np.column_stack([poses[:, 0, 3], poses[:, 1, 3], heading])


def _odometries() -> Iterator[tuple[str, Locate, bool]]:
    """The installed odometries, newly created, and whether they get points on the floor."""
    if find_spec("kiss_icp"):
        yield "kiss-icp", _kiss_icp(), True
        yield "kiss-icp without the floor", _kiss_icp(), False
    if find_spec("small_gicp"):
        yield "small-gicp", _small_gicp(), True


def _kiss_icp() -> Locate:
    config = import_module("kiss_icp.config").load_config(None)
    config.data.deskew = False  # The lidar stands still during a scan.
    config.registration.max_num_threads = 1
    odometry = import_module("kiss_icp.kiss_icp").KissICP(config)

    def locate(points: Float) -> Float:
        odometry.register_frame(points, np.array([]))
        return np.array(odometry.last_pose)

    return locate


def _small_gicp() -> Locate:
    """Scan-to-map registration; the last motion predicts the pose."""
    library: Any = import_module("small_gicp")
    places = library.GaussianVoxelMap(VOXEL)
    last = [np.eye(4), np.eye(4)]

    def locate(points: Float) -> Float:
        cloud, _ = library.preprocess_points(points, DOWNSAMPLING, num_threads=1)
        if places.size():
            expected = last[1] @ np.linalg.inv(last[0]) @ last[1]
            found = library.align(places, cloud, expected, num_threads=1)
            last[:] = last[1], found.T_target_source
        places.insert(cloud, last[1])
        return np.array(last[1])

    return locate


def _draw(rows: list[Row], wheels: Row, path: Path) -> None:
    """Draw errors over layers, a line for each noise and a panel for each odometry."""
    from matplotlib.figure import Figure as Sheet

    from lrf3d.base.files import replacing

    names = list(dict.fromkeys(row["of"] for row in rows))
    sheet = Sheet(figsize=(3 * len(names), 3.8), layout="constrained")
    panels = np.ravel(sheet.subplots(1, len(names), sharey=True))
    for axes, name in zip(panels, names, strict=True):
        mine = [row for row in rows if row["of"] == name]
        for shade, sigma in enumerate(dict.fromkeys(row["noise_m"] for row in mine)):
            line = [row for row in mine if row["noise_m"] == sigma]
            axes.loglog(
                [row["layers"] for row in line], [row["ape_m"] for row in line], "o-",
                color=f"C{shade}", label=f"σ = {1e3 * sigma:g} mm",
            )  # fmt: skip
        axes.axhline(wheels["ape_m"], color="0.5", ls="--", label="wheels that slip")
        counts = sorted({row["layers"] for row in mine})
        axes.set_xticks(counts, [str(count) for count in counts])
        axes.minorticks_off()
        axes.set(title=name, xlabel="layers")
        axes.grid(alpha=0.3)
    panels[0].set_ylabel("error of the trajectory [m]")
    panels[-1].legend(frameon=False)
    with replacing(path) as unfinished:
        sheet.savefig(unfinished, dpi=120)
