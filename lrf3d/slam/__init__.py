"""SLAM: poses and map from scans and odometry alone; ``lrf3d.slam(log)`` runs it over a log.

Examples:
    >>> import lrf3d
    >>> room = lrf3d.load_world("paper_room")
    >>> run = lrf3d.simulate(room, [(1 + 0.1 * k, 1, 0) for k in range(10)], rng=0)
    >>> lrf3d.export_run(run, "carmen", "drive.log")
    >>> lrf3d.slam(lrf3d.load_log("drive.log")).trajectory.poses[-1, :2].round(1).tolist()
    [1.9, 1.0]
"""

import sys
from types import ModuleType
from typing import TYPE_CHECKING, Any

from lrf3d.slam.log import LogSolution, run_of, solve_recording
from lrf3d.slam.log import slam as _slam
from lrf3d.slam.simulated import SlamMapper, WheelErrors
from lrf3d.slam.slam import Slam

__all__ = [
    "LogSolution",
    "Slam",
    "SlamMapper",
    "WheelErrors",
    "run_of",
    "slam",
    "solve_recording",
]


class _CallableModule(ModuleType):
    """The package and its main function have one name, ``lrf3d.slam``: so it is both."""

    def __call__(self, *arguments: Any, **settings: Any) -> Any:
        return _slam(*arguments, **settings)


sys.modules[__name__].__class__ = _CallableModule

if TYPE_CHECKING:
    slam = _slam
else:
    slam = sys.modules[__name__]
