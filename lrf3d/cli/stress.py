"""``lrf3d stress``: whether the numbers hold where they are hardest."""

from typing import Annotated

import typer

from lrf3d.cli import options


def stress(
    beams: Annotated[int, typer.Option(min=1, help="Beams to cast, at least.")] = 10_000_000,
    rationals: Annotated[
        int, typer.Option(min=0, help="Beams that rationals decide whatever error bounds say.")
    ] = 100_000,
    seconds: Annotated[
        float, typer.Option(min=0.0, help="Stop after this time and report what was tried.")
    ] = 480.0,
    seed: Annotated[
        int, typer.Option(min=0, help="Seed of the beams: the same seed, the same.")
    ] = 0,
    json: options.Json = False,
) -> None:
    """Cast beams that are hard to cast, and certify every one.

    Each beam is certified by an error bound, or by rationals where bounds cannot decide. Ends with
    the status 1 where a caster hits a wrong wall or none, or where a range is off by more than
    2 ulp; with Embree 1e-9 m, where that is more.
    """
    from lrf3d.cli.console import print_json, progress_bar
    from lrf3d.study.stress import stress as run

    with progress_bar("stress") as progress:
        report = run(beams, rationals=rationals, seconds=seconds, seed=seed, progress=progress)
    if json:
        print_json(report.as_dict())
    else:
        print(report.text())
    if not report.passed:
        raise typer.Exit(1)
