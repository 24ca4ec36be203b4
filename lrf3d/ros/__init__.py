"""ROS 2, live: a robot in a world that other programs see and drive, for ``lrf3d ros``."""

from collections.abc import Callable, Sequence
from typing import Any

from lrf3d.errors import expect
from lrf3d.interrupts import check
from lrf3d.ros.node import SecondClockError as SecondClockError
from lrf3d.ros.settings import Settings
from lrf3d.scenario import Scenario


def serve(
    scenario: Scenario,
    *,
    arguments: Sequence[str] = (),
    started: Callable[[str], None] = lambda text: None,
    **settings: Any,
) -> None:
    """Serve a robot in ROS 2 until the program is interrupted.

    Args:
        scenario: The world, and its robot and laser; a route is not needed.
        arguments: Arguments of ROS, such as ``--ros-args -r scan:=base_scan``.
        started: Called with a line once the topics are there.
        **settings: The fields of :class:`lrf3d.ros.settings.Settings`.

    Raises:
        MissingLibraryError: ROS 2 is not there.
        SecondClockError: Another program publishes the clock.
        InputError: A setting is invalid.
    """
    expect(scenario, Scenario, "scenario")
    from lrf3d.ros.node import serve_node

    serve_node(scenario.with_route(), Settings(**settings), arguments, started)
    check()
