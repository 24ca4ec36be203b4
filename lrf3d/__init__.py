"""lrf3d: a robot with a laser range finder in a world of walls, simulated, mapped and filmed.

The public names are loaded when they are first used, so that ``import lrf3d`` costs next to
nothing and loads no more than a program needs.
"""

from lrf3d.lazy import PAINTERS, loading

# Importing it from typing would take as long as all that is needed to handle Ctrl-C.
TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Any

    from lrf3d import plot
    from lrf3d.casting import EmbreeCaster, PlanarCaster, crosscheck
    from lrf3d.casting.dynamic_obstacle import DynamicObstacle
    from lrf3d.collecting import simulate
    from lrf3d.collision import check_drive
    from lrf3d.errors import (
        CollisionError,
        InputError,
        Lrf3dError,
        MissingLibraryError,
        OutputError,
        WorldError,
    )
    from lrf3d.exporting import export_run
    from lrf3d.fleet import simulate_fleet
    from lrf3d.io import load_log, load_run, record, save_run
    from lrf3d.laser import LaserRangeFinder, LaserScan, ProportionalNoise
    from lrf3d.localization import (
        KnownLines,
        Localiser,
        OdometryNoise,
        PoseEstimate,
        localise,
        odometry_increments,
    )
    from lrf3d.mapping import LineMap, LineMapper, load_map, save_map
    from lrf3d.planning.planner import plan_route
    from lrf3d.pose import Pose
    from lrf3d.recorded import map_log, slam_log
    from lrf3d.recorder import Recorder
    from lrf3d.render.video import render_video
    from lrf3d.robot import (
        AckermannDrive,
        DifferentialDrive,
        EstimatedTrajectory,
        Imu,
        OmniDrive,
        Trajectory,
        Unicycle,
        WheelOdometry,
        drive,
        follow_route,
    )
    from lrf3d.run import Run
    from lrf3d.scenario import Scenario, load_scenario
    from lrf3d.scoring import score_map, score_run
    from lrf3d.sessions import localise_log
    from lrf3d.simulation import Simulation, Step
    from lrf3d.slam import Slam
    from lrf3d.sweeping import SweepTable, sweep
    from lrf3d.version import __version__ as __version__
    from lrf3d.world import World, load_world, save_world, world_names
else:
    __getattr__, __dir__ = loading(
        globals(),
        {
            "casting": "EmbreeCaster PlanarCaster crosscheck",
            "casting.dynamic_obstacle": "DynamicObstacle",
            "collision": "check_drive",
            "errors": "CollisionError InputError Lrf3dError MissingLibraryError OutputError"
            " WorldError",
            "exporting": "export_run",
            "fleet": "simulate_fleet",
            "io": "load_log load_run record save_run",
            "laser": "LaserRangeFinder LaserScan ProportionalNoise",
            "localization": "KnownLines Localiser OdometryNoise PoseEstimate localise"
            " odometry_increments",
            "mapping": "LineMap LineMapper load_map save_map",
            "pose": "Pose",
            "recorded": "map_log slam_log",
            "recorder": "Recorder",
            "render.video": "render_video",
            "robot": "AckermannDrive DifferentialDrive EstimatedTrajectory Imu OmniDrive Trajectory"
            " Unicycle WheelOdometry drive follow_route",
            "planning.planner": "plan_route",
            "run": "Run",
            "scenario": "Scenario load_scenario",
            "scoring": "score_map score_run",
            "sessions": "localise_log",
            "simulation": "Simulation Step",
            "collecting": "simulate",
            "slam": "Slam",
            "sweeping": "SweepTable sweep",
            "version": "__version__",
            "world": "World load_world save_world world_names",
            "": "plot",
        },
    )

__all__ = [
    "AckermannDrive", "CollisionError", "DifferentialDrive", "DynamicObstacle", "EmbreeCaster",
    "EstimatedTrajectory", "Imu", "InputError", "KnownLines", "LaserRangeFinder", "LaserScan",
    "LineMap", "LineMapper", "Localiser", "Lrf3dError", "MissingLibraryError", "OdometryNoise",
    "OmniDrive", "OutputError", "PlanarCaster", "Pose", "PoseEstimate", "ProportionalNoise",
    "Recorder", "Run", "Scenario", "Simulation", "Slam", "Step", "SweepTable", "Trajectory",
    "Unicycle", "WheelOdometry", "World", "WorldError", "check_drive", "crosscheck", "drive",
    "export_run", "follow_route", "load_log", "load_map", "load_run", "load_scenario", "load_world",
    "localise", "localise_log", "map_log", "odometry_increments", "plan_route", "plot", "record",
    "render_video", "save_map", "save_run", "save_world", "score_map", "score_run", "simulate",
    "simulate_fleet", "slam_log", "sweep", "world_names",
]  # fmt: skip


def _figure(value: "Any") -> bytes:
    from lrf3d.plot import png

    return png(value)


def _frame(run: "Run", *args: "Any", **options: "Any") -> "Any":
    from lrf3d.render.video import frame

    return frame(run, *args, **options)


def _film(run: "Run", *args: "Any", **options: "Any") -> "Any":
    from lrf3d.render.video import render_video

    return render_video(run, *args, **options)


# Values are drawn by layers above them, which are loaded when a picture is asked for.
PAINTERS.update(figure=_figure, frame=_frame, film=_film)
