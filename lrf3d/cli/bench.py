"""``lrf3d bench``: run time against error, of everything or of one part."""

from pathlib import Path
from typing import Annotated, Any

import typer

from lrf3d.cli import options

Figure = Annotated[Path | None, typer.Option(help="A picture .png of time and error.")]

bench = typer.Typer(
    help="Measure run time against error.",
    rich_markup_mode=None,
    invoke_without_command=True,
    add_completion=False,
    epilog="Example: lrf3d bench --out out/bench --compare old/report.json",
)


@bench.callback()
def everything(
    context: typer.Context,
    out: Annotated[Path, typer.Option(help="Folder for report.html and report.json.")] = Path(
        "out/bench"
    ),
    seconds: Annotated[float, typer.Option(min=10.0, help="Time for all parts.")] = 540.0,
    part: Annotated[
        list[str] | None,
        typer.Option(help="Only this part: ranges, maps, poses or frames; repeatable."),
    ] = None,
    compare: Annotated[
        Path | None,
        typer.Option(
            metavar="OLD.json", help="Tell what became slower or less exact since this report."
        ),
    ] = None,
    json: options.Json = False,
) -> None:
    """Measure run time against error: all parts, into one page, or one of them by its command."""
    if context.invoked_subcommand is not None:
        return
    from lrf3d.cli.console import json_text, print_json, progress_bar, warn
    from lrf3d.errors import InputError
    from lrf3d.output import make_folder, write_text
    from lrf3d.study.bench.comparison import compare as compare_reports
    from lrf3d.study.bench.comparison import load_report
    from lrf3d.study.bench.parts import PARTS
    from lrf3d.study.bench.report_page import page_text
    from lrf3d.study.bench.whole import bench_all
    from lrf3d.study.bench.whole_text import whole_text

    chosen = tuple(PARTS) if part is None else tuple(part)
    for name in chosen:
        if name not in PARTS:
            raise InputError(f"--part {name}: expected one of {', '.join(PARTS)}")
    # What cannot be read or written is found before the minutes of work.
    old = None if compare is None else load_report(compare)
    make_folder(out)
    with progress_bar("bench") as progress:
        report = bench_all(seconds=seconds, chosen=chosen, progress=progress)
    comparison = None if old is None else compare_reports(report, old, str(compare))
    told = report.as_dict()
    if comparison is not None:
        told["comparison"] = comparison.as_dict()
    for key, why in report.left_out.items():
        warn(f"{key}: left out: {why}")
    write_text(out / "report.json", json_text(told))
    write_text(out / "report.html", page_text(report, comparison))
    if json:
        print_json(told)
    else:
        print(f"{whole_text(report, comparison)}\n\n{out / 'report.html'}")


@bench.command(epilog="Example: lrf3d bench scan --walls 400,10000 --figure scan.png")
def scan(
    walls: Annotated[
        str, typer.Option(metavar="N,N,…", help="Sizes of the worlds [walls].")
    ] = "40,400,10000,100000,1000000",
    seconds: Annotated[
        float, typer.Option(min=1.0, help="Time for all; sizes that need more are left out.")
    ] = 150.0,
    ablate: Annotated[
        bool, typer.Option("--ablate", help="Also time each piece of skipped work on and off.")
    ] = False,
    figure: Figure = None,
    json: options.Json = False,
) -> None:
    """Cast scans with lrf3d and with its rivals: how long it takes, and how far it is off.

    Open3D and MuJoCo take part where they are installed: pip install 'lrf3d[bench]'.
    """
    from lrf3d.cli.console import progress_bar
    from lrf3d.study.bench.scan import bench_scan
    from lrf3d.study.bench.text import scan_text

    sizes = sorted(set(_numbers("--walls", walls, least=4)))
    with progress_bar("bench scan") as progress:
        result = bench_scan(sizes, seconds=seconds, with_ablation=ablate, progress=progress)
    _tell(result, scan_text(result), json)
    if figure is not None:
        from lrf3d.study.bench.figure import draw_scan_benchmark

        draw_scan_benchmark(result, figure)


@bench.command(name="map", epilog="Example: lrf3d bench map --seeds 1 --figure map.png")
def map_(
    seeds: Annotated[int, typer.Option(min=1, help="Seeds of the noise for each setting.")] = 2,
    seconds: Annotated[
        float, typer.Option(min=1.0, help="Time for all; what needs more is left out.")
    ] = 125.0,
    figure: Annotated[Path | None, typer.Option(help="A picture .png of error and time.")] = None,
    json: options.Json = False,
) -> None:
    """Map with many thresholds, beams, noises and map sizes: how far off, how long, how much.

    Also counts the numbers that a map takes to store, and the comparisons that line pairs take.
    """
    from lrf3d.cli.console import progress_bar
    from lrf3d.study.bench.map_bench import bench_map
    from lrf3d.study.bench.map_text import map_text

    with progress_bar("bench map") as progress:
        result = bench_map(seeds=seeds, seconds=seconds, progress=progress)
    _tell(result, map_text(result), json)
    if figure is not None:
        from lrf3d.study.bench.map_figure import draw_map_benchmark

        draw_map_benchmark(result, figure)


@bench.command(epilog="Example: lrf3d bench score footprints.geojson --beams 181 --seeds 2")
def score(
    source: Annotated[
        str,
        typer.Argument(
            metavar="SOURCE",
            help="A world or its file; a CARMEN log; or an .npz of single scans.",
        ),
    ],
    mode: options.ModeOption = None,
    sigma: Annotated[float, typer.Option(help="Noise [m] at the farthest range.")] = 0.04,
    seeds: Annotated[int, typer.Option(min=1, help="A world: seeds of poses and noise.")] = 6,
    poses: Annotated[int, typer.Option(min=1, help="A world: random poses in the open.")] = 200,
    beams: Annotated[
        str, typer.Option(metavar="N,N,…", help="A world: beams of a scan.")
    ] = "721,181",
    simplify: Annotated[
        float | None,
        typer.Option(min=0.0, help="GeoJSON: corners up to this [m] off a façade are left out."),
    ] = None,
    vertices: Annotated[
        str, typer.Option(metavar="N,N,…", help="Single scans: vertices of a scan's lines.")
    ] = "10,20,30,50",
    json: options.Json = False,
) -> None:
    """Score maps of a world or a log in both modes side by side, or the lines of single scans.

    A world is seen from random poses, 1 m off all walls, and its map is compared with the walls
    that were visible. The even scans of a log build a map and the odd ones test it.
    """
    from lrf3d.cli.console import progress_bar
    from lrf3d.study.bench.score_bench import ScoreChoice, bench_score
    from lrf3d.study.bench.score_text import score_text

    chosen = {} if mode is None else {"modes": (mode.value,)}
    choice = ScoreChoice(
        **chosen,
        sigma=sigma,
        seeds=seeds,
        poses=poses,
        beams=tuple(_numbers("--beams", beams, least=3)),
        simplify=simplify,
        vertices=tuple(_numbers("--vertices", vertices, least=2)),
    )
    with progress_bar("bench score") as progress:
        result = bench_score(source, choice, progress=progress)
    _tell(result, score_text(result), json)


@bench.command(epilog="Example: lrf3d bench render --figure render.png")
def render(
    buildings: Annotated[
        str, typer.Option(metavar="N,N,…", help="Sizes of the generated cities [buildings].")
    ] = "40,400,4000",
    seconds: Annotated[
        float, typer.Option(min=1.0, help="Time for all; what has begun is finished.")
    ] = 90.0,
    ablate: Annotated[
        bool, typer.Option("--ablate", help="Also time each piece of skipped work on and off.")
    ] = False,
    figure: Figure = None,
    json: options.Json = False,
) -> None:
    """Draw frames with lrf3d and with stock pyrender: how long it takes, and how clean they are."""
    from lrf3d.cli.console import progress_bar
    from lrf3d.render.gl import require_gl

    require_gl()
    from lrf3d.study.bench.render_bench import bench_render
    from lrf3d.study.bench.render_text import render_text

    sizes = sorted(set(_numbers("--buildings", buildings, least=4)))
    with progress_bar("bench render") as progress:
        result = bench_render(sizes, seconds=seconds, with_ablation=ablate, progress=progress)
    _tell(result, render_text(result), json)
    if figure is not None:
        from lrf3d.study.bench.render_figure import draw_render_benchmark

        draw_render_benchmark(result, figure)


@bench.command(epilog="Example: lrf3d bench robots --robots 1024")
def robots(
    world: Annotated[str, typer.Argument(metavar="WORLD", help="The world.")] = "city",
    count: Annotated[int, typer.Option("--robots", min=1, help="How many robots.")] = 1024,
    seconds: Annotated[float, typer.Option(min=0.1, help="For how long.")] = 10.0,
    seed: options.Seed = 0,
    json: options.Json = False,
) -> None:
    """Drive many robots at once, as environments of Gymnasium: steps and beams a second.

    Needs Gymnasium: pip install 'lrf3d[gym]'.
    """
    from lrf3d.cli.console import print_json, print_table, progress_bar
    from lrf3d.study.bench.robots import bench_robots

    with progress_bar("bench robots") as progress:
        result = bench_robots(world, robots=count, seconds=seconds, seed=seed, progress=progress)
    if json:
        print_json(result.as_dict())
    else:
        print_table(result.rows())


@bench.command(epilog="Example: lrf3d bench drive --figure drive.png")
def drive(
    seconds: Annotated[
        float, typer.Option(min=1.0, help="Time for all; what needs more is timed once.")
    ] = 60.0,
    figure: Figure = None,
    json: options.Json = False,
) -> None:
    """Drive an hour with Euler, RK4, RK45 and exact arcs: how far off the end is, and how long."""
    from lrf3d.cli.console import progress_bar
    from lrf3d.study.bench.drive_bench import bench_drive
    from lrf3d.study.bench.drive_text import drive_text

    with progress_bar("bench drive") as progress:
        result = bench_drive(seconds=seconds, progress=progress)
    _tell(result, drive_text(result), json)
    if figure is not None:
        from lrf3d.study.bench.drive_figure import draw_drive_benchmark

        draw_drive_benchmark(result, figure)


def _tell(result: Any, text: str, json: bool) -> None:
    """Print a result as one JSON object or as a text, before a picture of it is drawn."""
    from lrf3d.cli.console import print_json

    if json:
        print_json(result.as_dict())
    else:
        print(text, flush=True)


def _numbers(option: str, text: str, *, least: int) -> list[int]:
    """Whole numbers from a text with commas between them."""
    from lrf3d.errors import InputError

    parts = [part.strip().replace("_", "") for part in text.split(",")]
    if not all(part.isdigit() and int(part) >= least for part in parts):
        raise InputError(f"{option} {text}: expected whole numbers from {least}, such as 400,10000")
    return [int(part) for part in parts]
