"""``lrf3d ros``: a robot that other programs see and drive."""

from argparse import Namespace

from lrf3d.cli.console import Report
from lrf3d.cli.inputs import routed
from lrf3d.scenario import Scenario

_OPTIONS = "rate speed_up give wheels cmd_timeout lines"


def ros(scenario: Scenario, args: Namespace, report: Report) -> None:
    """Serve a robot in ROS 2."""
    from lrf3d.ros import serve

    serve(
        scenario if scenario.start else routed(scenario, args, report),
        arguments=args.ros_words,
        started=report.note,
        namespace=args.namespace or "",
        clock=not args.no_clock,
        rng=args.seed,
        **{name: vars(args)[name] for name in _OPTIONS.split()},
    )
