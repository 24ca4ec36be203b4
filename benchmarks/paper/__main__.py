"""``scripts/paper``: every figure and claim of the paper, measured, on one page."""

from pathlib import Path
from typing import Annotated

import typer

from lrf3d.cli import main, options

app = typer.Typer(rich_markup_mode=None, pretty_exceptions_enable=False, add_completion=False)


@app.command(epilog="Example: scripts/paper --out out/paper")
def paper(
    out: Annotated[Path, typer.Option(help="Folder for the results.")] = Path("out/paper"),
    seeds: Annotated[int, typer.Option(min=2, help="Number of noise seeds in the room.")] = 20,
    json: options.Json = False,
) -> None:
    """Redo every figure and claim of Teslić, Škrjanc and Klančar on one page.

    Writes paper.html, which needs no other file, and paper.json. Takes a minute or two.
    """
    from benchmarks.paper.claim import Extent
    from benchmarks.paper.report import page_text, redo_paper
    from lrf3d.cli.console import json_text, print_json, print_table, progress_bar
    from lrf3d.output import make_folder, write_text

    folder = make_folder(out)
    with progress_bar("paper") as progress:
        report = redo_paper(Extent(seeds=seeds), progress=progress)
    files = {"page": folder / "paper.html", "figures": folder / "paper.json"}
    write_text(files["figures"], json_text(report.as_dict()))
    write_text(files["page"], page_text(report))
    if json:
        print_json(report.as_dict())
        return
    rows = [(claim.verdict, claim.title) for claim in report.claims]
    print_table([*rows, *((name, str(path)) for name, path in files.items())])


if __name__ == "__main__":
    main(app, "scripts/paper")
