"""lrf3d: a robot with a laser range finder in a world of walls, simulated, mapped and filmed.

The public names are loaded when they are first used, so that ``import lrf3d`` costs next to
nothing and loads no more than a program needs.
"""

from importlib import import_module

# Importing it from typing would take as long as all that is needed to handle Ctrl-C.
TYPE_CHECKING = False
if TYPE_CHECKING:
    from lrf3d.casting import EmbreeCaster, PlanarCaster, crosscheck
    from lrf3d.casting.mover import Mover
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
    from lrf3d.pose import Pose
    from lrf3d.render.video import render_video
    from lrf3d.robot import Trajectory, Unicycle, check_drive, drive, follow_route
    from lrf3d.robot.planner import plan_route
    from lrf3d.run import Run
    from lrf3d.scenario import Scenario
    from lrf3d.scenario_file import load_scenario
    from lrf3d.scoring import score_map, score_run
    from lrf3d.simulation import Simulation, Step, simulate
    from lrf3d.world import World, load_world, save_world, world_names

_HOMES = {
    "casting": ["EmbreeCaster", "PlanarCaster", "crosscheck"],
    "casting.mover": ["Mover"],
    "errors": [
        "CollisionError",
        "InputError",
        "Lrf3dError",
        "MissingLibraryError",
        "OutputError",
        "WorldError",
    ],
    "exporting": ["export_run"],
    "fleet": ["simulate_fleet"],
    "laser": ["LaserRangeFinder", "LaserScan", "ProportionalNoise"],
    "localization": [
        "KnownLines",
        "Localiser",
        "OdometryNoise",
        "PoseEstimate",
        "localise",
        "odometry_increments",
    ],
    "io": ["load_log", "load_run", "record", "save_run"],
    "mapping": ["LineMap", "LineMapper", "load_map", "save_map"],
    "pose": ["Pose"],
    "render.video": ["render_video"],
    "robot": ["Trajectory", "Unicycle", "check_drive", "drive", "follow_route"],
    "robot.planner": ["plan_route"],
    "run": ["Run"],
    "scenario": ["Scenario"],
    "scenario_file": ["load_scenario"],
    "scoring": ["score_map", "score_run"],
    "simulation": ["Simulation", "Step", "simulate"],
    "world": ["World", "load_world", "save_world", "world_names"],
}
_HOME = {name: home for home, names in _HOMES.items() for name in names}

__all__ = [
    "CollisionError",
    "EmbreeCaster",
    "InputError",
    "KnownLines",
    "LaserRangeFinder",
    "LaserScan",
    "LineMap",
    "LineMapper",
    "Localiser",
    "Lrf3dError",
    "MissingLibraryError",
    "Mover",
    "OdometryNoise",
    "OutputError",
    "PlanarCaster",
    "Pose",
    "PoseEstimate",
    "ProportionalNoise",
    "Run",
    "Scenario",
    "Simulation",
    "Step",
    "Trajectory",
    "Unicycle",
    "World",
    "WorldError",
    "check_drive",
    "crosscheck",
    "drive",
    "export_run",
    "follow_route",
    "load_log",
    "load_map",
    "load_run",
    "load_scenario",
    "load_world",
    "localise",
    "odometry_increments",
    "plan_route",
    "record",
    "render_video",
    "save_map",
    "save_run",
    "save_world",
    "score_map",
    "score_run",
    "simulate",
    "simulate_fleet",
    "world_names",
]


def __getattr__(name: str) -> object:
    """Load a public name from its module at its first use."""
    if name == "__version__":
        from importlib.metadata import version

        globals()[name] = version("lrf3d")
        return globals()[name]
    if name not in _HOME:
        raise AttributeError(f"module 'lrf3d' has no attribute {name!r}")
    value = getattr(import_module(f"lrf3d.{_HOME[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return __all__
