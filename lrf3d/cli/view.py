"""``lrf3d view``: a run or a world in the browser."""

from typing import Annotated

import typer

from lrf3d.cli.console import Report
from lrf3d.cli.options import Drive, Seed


def view(
    what: Annotated[str, typer.Argument(metavar="RUN|WORLD")],
    drive: Drive,
    report: Report,
    host: str = "127.0.0.1",
    port: Annotated[int | None, typer.Option(min=1, max=65535)] = None,
    browser: bool = True,
    playback: Annotated[float | None, typer.Option(min=0.01)] = None,
    seed: Seed = 0,
) -> None:
    """Play a run in the browser, or drive through a world by hand.

    A run can be played, paused and scrubbed. In a world the arrow keys or the pads on the page
    drive the robot, which scans and maps as it goes. Ctrl-C ends the server.

    Options:
        what: A run.npz or its folder to play, or a world to drive in. A built-in world comes before
            a folder of the same name: write ./NAME for that.
        host: Address or name to listen at; 0.0.0.0 lets other machines in. The page opens only by
            this name, an address, or the machine's host name.
        port: Port; the first free one from 8080 if not given.
        browser: Open the browser.
        playback: Simulated seconds per second.
    """
    from lrf3d.io.reading import is_run
    from lrf3d.world.files import find_world

    run = is_run(what)
    if not run:
        # An unknown name is reported before the server is imported.
        find_world(what)
    from lrf3d.view.server import bound, run_view, serve, world_view

    def say(address: str) -> None:
        text = f"{what} is shown at {address}; Ctrl-C ends it"
        report.print({"address": address}, [("view", text)])

    # A wrong address is refused before the work.
    with bound(host, port) as door:
        make = run_view(what, playback) if run else world_view(drive.read(what, report), seed)
        serve(make, door, host=host, browser=browser, started=say)
