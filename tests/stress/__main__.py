"""``scripts/stress``: whether the numbers hold where they are hardest."""

from typing import Annotated

import typer

from lrf3d.cli import main, options

app = typer.Typer(rich_markup_mode=None, pretty_exceptions_enable=False, add_completion=False)

QUICK_BEAMS = 100_000
"""Beams of a short run."""


@app.command(epilog="Example: scripts/stress --quick")
def stress(
    beams: Annotated[int, typer.Option(min=1, help="Beams to cast, at least.")] = 10_000_000,
    rationals: Annotated[
        int, typer.Option(min=0, help="Beams that rationals decide whatever error bounds say.")
    ] = 100_000,
    part: Annotated[
        list[str] | None,
        typer.Option(
            help="Only this part: casting, light, lines, angles, driving, localising, worlds or"
            " frames; repeatable."
        ),
    ] = None,
    quick: Annotated[
        bool, typer.Option("--quick", help="A little of everything in some ten seconds.")
    ] = False,
    seconds: Annotated[
        float, typer.Option(min=0.0, help="Stop after this time and report what was tried.")
    ] = 480.0,
    seed: Annotated[
        int, typer.Option(min=0, help="Seed of the beams: the same seed, the same.")
    ] = 0,
    json: options.Json = False,
) -> None:
    """Try every part of lrf3d where it is hardest, against exact answers.

    Each beam is certified by an error bound, or by rationals where bounds cannot decide: the right
    wall, and a range within 2 ulp; with Embree 1e-9 m, where that is more. Beams that mirrors turn
    are followed by fractions: each wall of the way, and 1 ulp a leg. Lines, angles, drives
    and the filter are compared with rationals or with sums that round nothing; worlds of no wall
    and of a million are cast at, mapped, planned in and extruded. Ends with the status 1 where
    anything fails.
    """
    from lrf3d.cli.console import print_json, progress_bar
    from lrf3d.errors import InputError
    from stress.running import CASES
    from stress.running import stress as run

    known = dict.fromkeys(case.part for case in CASES)
    for name in part or ():
        if name not in known:
            raise InputError(f"--part {name}: expected one of {', '.join(known)}")
    if quick:
        beams, rationals = min(beams, QUICK_BEAMS), min(rationals, QUICK_BEAMS // 100)
    with progress_bar("stress") as progress:
        report = run(
            beams,
            rationals=rationals,
            quick=quick,
            parts=part or (),
            seconds=seconds,
            seed=seed,
            progress=progress,
        )
    if json:
        print_json(report.as_dict())
    else:
        print(report.text())
    if not report.passed:
        raise typer.Exit(1)


if __name__ == "__main__":
    main(app, "scripts/stress")
