"""``lrf3d view`` and ``export``: runs in the browser and for other programs."""

from argparse import Namespace

from lrf3d.cli.console import Report
from lrf3d.cli.film import folder_of
from lrf3d.cli.inputs import routed
from lrf3d.exporting import EXPORTERS, export_run
from lrf3d.files import make_folder
from lrf3d.run import Run
from lrf3d.scenario import Scenario
from lrf3d.view.server import bound, run_view, serve, world_view


def view(scenario: Scenario | None, args: Namespace, report: Report) -> None:
    """Play a run in the browser, or drive through a world by hand."""

    def say(address: str) -> None:
        text = f"{args.world} is shown at {address}; Ctrl-C ends it"
        report.print({"address": address}, [("view", text)])

    # A wrong address is refused before the work.
    with bound(args.host, args.port) as door:
        if scenario is None:
            make = run_view(args.world, args.playback)
        else:
            make = world_view(routed(scenario, args, report), args.seed)
        serve(make, door, host=args.host, browser=args.browser, started=say)


def export(run: Run, args: Namespace, report: Report) -> None:
    """Write a run for another program."""
    path = args.out or folder_of(args.run) / EXPORTERS[args.to]
    make_folder(path.parent)
    export_run(run, args.to, path, every=args.every)
    files = [path] if path.is_file() else sorted(path.iterdir())
    scans, size = len(range(0, len(run), args.every)), sum(file.stat().st_size for file in files)
    report.print(
        {"file": str(path), "format": args.to, "scans": scans, "bytes": size},
        [(args.to, str(path)), ("scans", f"{scans:,}"), ("size", f"{size / 1e6:.1f} MB")],
    )
