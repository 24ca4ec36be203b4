"""SLAM: poses and map from scans and odometry alone; ``lrf3d.slam(log)`` runs it over a log."""

import sys
from types import ModuleType
from typing import TYPE_CHECKING, Any

from lrf3d.slam.log import LogSolution, run_of, solve_recording
from lrf3d.slam.log import slam as _slam
from lrf3d.slam.slam import Slam

__all__ = ["LogSolution", "Slam", "run_of", "slam", "solve_recording"]


class _CallableModule(ModuleType):
    """The package and its main function have one name, ``lrf3d.slam``: so it is both."""

    def __call__(self, *arguments: Any, **settings: Any) -> Any:
        return _slam(*arguments, **settings)


sys.modules[__name__].__class__ = _CallableModule

if TYPE_CHECKING:
    slam = _slam
else:
    slam = sys.modules[__name__]
