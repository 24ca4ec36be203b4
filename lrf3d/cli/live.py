"""``lrf3d ros``: a robot that other programs see and drive."""

from argparse import Namespace

from lrf3d.cli.console import Report, say
from lrf3d.cli.inputs import routed
from lrf3d.scenario import Scenario

_OPTIONS = "rate robots speed_up give wheels cmd_timeout lines"


def ros(scenario: Scenario, args: Namespace, report: Report) -> int | None:
    """Serve a robot in ROS 2; a second clock is wrong usage, and returns 2."""
    from lrf3d.ros import SecondClockError, serve

    try:
        serve(
            scenario if scenario.start else routed(scenario, args, report),
            arguments=args.ros_words,
            started=report.note,
            namespace=args.namespace or "",
            clock=not args.no_clock,
            rng=args.seed,
            **{name: vars(args)[name] for name in _OPTIONS.split()},
        )
    except SecondClockError as error:
        say(str(error))
        return 2
    return None
