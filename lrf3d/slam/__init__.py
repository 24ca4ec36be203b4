"""SLAM: poses and map from scans and odometry alone; ``lrf3d.slam(log)`` runs it over a log."""

import sys
from types import ModuleType
from typing import Any

from lrf3d.slam.log import LogSolution, run_of, slam, solve_recording
from lrf3d.slam.slam import Slam

__all__ = ["LogSolution", "Slam", "run_of", "slam", "solve_recording"]


class _CallableModule(ModuleType):
    """The module that a package of this name is: ``lrf3d.slam`` is both it and its function."""

    def __call__(self, *arguments: Any, **settings: Any) -> Any:
        return slam(*arguments, **settings)


sys.modules[__name__].__class__ = _CallableModule
