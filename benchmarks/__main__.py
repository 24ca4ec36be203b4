"""``scripts/bench``: run time against error, of everything or of one part."""

import sys
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from lrf3d.cli import main, options

if TYPE_CHECKING:
    from collections.abc import Callable

    from benchmarks.result import Result

Figure = Annotated[Path | None, typer.Option(help="Draw time and error to this .png.")]
Ablate = Annotated[
    bool, typer.Option("--ablate", help="Also measure with and without each optimisation.")
]

app = typer.Typer(
    help="Measure run time against error; all parts if none is named.",
    epilog="Example: scripts/bench --out out/bench --compare old/report.json",
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    add_completion=False,
)


@app.command(epilog="Example: scripts/bench whole --out out/bench --compare old/report.json")
def whole(
    out: Annotated[Path, typer.Option(help="Folder for report.html and report.json.")] = Path(
        "out/bench"
    ),
    seconds: Annotated[float, typer.Option(min=10.0, help="Time for all parts [s].")] = 540.0,
    part: Annotated[
        list[str] | None,
        typer.Option(help="Only this part: ranges, maps, poses or frames; repeatable."),
    ] = None,
    compare: Annotated[
        Path | None,
        typer.Option(
            metavar="OLD.json", help="Print what became slower or less exact since this report."
        ),
    ] = None,
    json: options.Json = False,
) -> None:
    """Measure all parts, within ten minutes, and put them onto one page."""
    from benchmarks.comparison import compare as compare_reports
    from benchmarks.comparison import comparison_text, load_report
    from benchmarks.whole import PARTS, bench_all
    from lrf3d.cli.console import json_text, print_json, progress_bar, warn
    from lrf3d.errors import InputError
    from lrf3d.output import make_folder, write_text

    chosen = tuple(PARTS) if part is None else tuple(part)
    for name in chosen:
        if name not in PARTS:
            raise InputError(f"--part {name}: expected one of {', '.join(PARTS)}")
    # What cannot be read or written is found before the minutes of work.
    old = None if compare is None else load_report(compare)
    make_folder(out)
    with progress_bar("bench") as progress:
        report = bench_all(seconds=seconds, chosen=chosen, progress=progress)
    found, text = report.as_dict(), report.text()
    if old is not None:
        comparison = compare_reports(report, old, str(compare))
        found["comparison"] = comparison.as_dict()
        text += f"\n\n{comparison_text(comparison)}"
    for key, why in report.left_out.items():
        warn(f"{key}: left out: {why}")
    write_text(out / "report.json", json_text(found))
    write_text(out / "report.html", report.page())
    if json:
        print_json(found)
    else:
        print(f"{text}\n\n{out / 'report.html'}")


@app.command(epilog="Example: scripts/bench scan --walls 400,10000 --figure scan.png")
def scan(
    walls: Annotated[
        str, typer.Option(metavar="N,N,…", help="Sizes of the worlds [walls].")
    ] = "40,400,10000,100000,1000000",
    seconds: Annotated[
        float, typer.Option(min=1.0, help="Time for all [s]; sizes that need more are left out.")
    ] = 150.0,
    ablate: Ablate = False,
    figure: Figure = None,
    json: options.Json = False,
) -> None:
    """Cast scans with lrf3d and with its peers: how long it takes, and how far it is off.

    Open3D and MuJoCo take part where they are installed: .venv/bin/pip install -e '.[bench]'.
    """
    from benchmarks.scan.benchmark import bench_scan

    sizes = sorted(set(_numbers("--walls", walls, least=4)))
    choice: Any = {"seconds": seconds, "with_ablation": ablate}
    _measure("scan", partial(bench_scan, sizes, **choice), json, figure)


@app.command(name="map", epilog="Example: scripts/bench map --seeds 1 --figure map.png")
def map_(
    seeds: Annotated[int, typer.Option(min=1, help="Seeds of the noise for each setting.")] = 2,
    seconds: Annotated[
        float, typer.Option(min=1.0, help="Time for all [s]; what needs more is left out.")
    ] = 125.0,
    figure: Figure = None,
    json: options.Json = False,
) -> None:
    """Map with many thresholds, beams, noises and map sizes: how far off, how long, how much.

    Also counts the numbers that a map takes to store, and the comparisons that line pairs take.
    """
    from benchmarks.map.benchmark import bench_map

    _measure("map", partial(bench_map, seeds=seeds, seconds=seconds), json, figure)


@app.command(epilog="Example: scripts/bench score footprints.geojson --beams 181 --seeds 2")
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
        str, typer.Option(metavar="N,N,…", help="A world: numbers of beams.")
    ] = "721,181",
    simplify: Annotated[
        float | None,
        typer.Option(min=0.0, help="GeoJSON: corners up to this [m] off a façade are left out."),
    ] = None,
    vertices: Annotated[
        str, typer.Option(metavar="N,N,…", help="Single scans: numbers of vertices.")
    ] = "10,20,30,50",
    json: options.Json = False,
) -> None:
    """Score maps of a world or a log in both modes side by side, or the lines of single scans.

    A world is seen from random poses, 1 m off all walls, and its map is compared with the walls
    that were visible. The even scans of a log build a map and the odd ones test it.
    """
    from benchmarks.score.benchmark import MODES, bench_score

    bench = partial(
        bench_score,
        source,
        modes=MODES if mode is None else (mode.value,),
        sigma=sigma,
        seeds=seeds,
        poses=poses,
        beams=_numbers("--beams", beams, least=3),
        simplify=simplify,
        vertices=_numbers("--vertices", vertices, least=2),
    )
    _measure("score", bench, json)


@app.command(epilog="Example: scripts/bench render --figure render.png")
def render(
    buildings: Annotated[
        str, typer.Option(metavar="N,N,…", help="Sizes of the generated cities [buildings].")
    ] = "40,400,4000",
    seconds: Annotated[
        float,
        typer.Option(min=1.0, help="Time for all [s]; a measurement that has begun is finished."),
    ] = 90.0,
    ablate: Ablate = False,
    figure: Figure = None,
    json: options.Json = False,
) -> None:
    """Draw frames with lrf3d and with stock pyrender: how long it takes, and how clean they are."""
    from lrf3d.render.gl import require_gl

    require_gl()
    from benchmarks.render.benchmark import bench_render

    sizes = sorted(set(_numbers("--buildings", buildings, least=4)))
    choice: Any = {"seconds": seconds, "with_ablation": ablate}
    _measure("render", partial(bench_render, sizes, **choice), json, figure)


@app.command(epilog="Example: scripts/bench robots --robots 1024")
def robots(
    world: Annotated[str, typer.Argument(metavar="WORLD", help="The world.")] = "city",
    count: Annotated[int, typer.Option("--robots", min=1, help="Number of robots.")] = 1024,
    seconds: Annotated[float, typer.Option(min=0.1, help="How long to measure [s].")] = 10.0,
    seed: options.Seed = 0,
    json: options.Json = False,
) -> None:
    """Drive many robots at once, as environments of Gymnasium: steps and beams a second."""
    from benchmarks.robots import bench_robots

    choice: Any = {"robots": count, "seconds": seconds, "seed": seed}
    _measure("robots", partial(bench_robots, world, **choice), json)


@app.command(epilog="Example: scripts/bench drive --figure drive.png")
def drive(
    seconds: Annotated[
        float, typer.Option(min=1.0, help="Time for all [s]; what needs more is timed once.")
    ] = 60.0,
    figure: Figure = None,
    json: options.Json = False,
) -> None:
    """Drive an hour with Euler, RK4, RK45 and exact arcs: how far off the end is, and how long."""
    from benchmarks.drive import bench_drive

    _measure("drive", partial(bench_drive, seconds=seconds), json, figure)


@app.command(epilog="Example: scripts/bench slam --figure slam.png")
def slam(
    log: Annotated[
        Path | None, typer.Option(help="A recorded log; a simulated drive if not given.")
    ] = None,
    relations: Annotated[
        Path | None, typer.Option(help="Relations of the log: lines a b dx dy dtheta.")
    ] = None,
    scans: Annotated[int, typer.Option(min=20, help="Scans of the simulated drive.")] = 900,
    spacings: Annotated[
        str, typer.Option(metavar="M,M,…", help="Distances between key scans [m].")
    ] = "0.25,0.35,0.5,0.7,1",
    figure: Figure = None,
    json: options.Json = False,
) -> None:
    """Solve a drive by SLAM at several key spacings: how far off it is, and how long it takes."""
    from benchmarks.slam import Drive, bench_slam
    from lrf3d.errors import InputError
    from lrf3d.io import load_log
    from lrf3d.io.trajectory_files import load_relations

    if (log is None) != (relations is None):
        raise InputError("--log and --relations: the one needs the other; give both or none")
    metres = [float(part) for part in spacings.split(",") if part.replace(".", "", 1).isdigit()]
    if len(metres) != len(spacings.split(",")) or not min(metres, default=0.0) > 0.0:
        raise InputError(f"--spacings {spacings}: expected distances in metres, such as 0.25,0.5")
    if log is None or relations is None:
        drive = Drive.simulated(scans)
    else:
        drive = Drive.recorded(load_log(log), load_relations(relations))
    _measure("slam", partial(bench_slam, drive, metres), json, figure)


def _measure(
    part: str, bench: "Callable[..., Result]", json: bool, figure: Path | None = None
) -> None:
    """Run a benchmark, print its result as one JSON object or as tables, and then draw it."""
    from lrf3d.cli.console import print_json, progress_bar

    with progress_bar(f"bench {part}") as progress:
        result = bench(progress=progress)
    if json:
        print_json(result.as_dict())
    else:
        print(result.text(), flush=True)
    if figure is not None:
        result.draw(figure)
        if not json:
            print(f"picture {figure}")


def _numbers(option: str, text: str, *, least: int) -> list[int]:
    """Whole numbers from a text with commas between them."""
    from lrf3d.errors import InputError

    parts = [part.strip().replace("_", "") for part in text.split(",")]
    if not all(part.isdigit() and int(part) >= least for part in parts):
        raise InputError(f"{option} {text}: expected whole numbers from {least}, such as 400,10000")
    return [int(part) for part in parts]


if __name__ == "__main__":
    words = sys.argv[1:]
    if not words or (words[0].startswith("-") and words[0] != "--help"):
        sys.argv.insert(1, "whole")
    main(app, "scripts/bench")
