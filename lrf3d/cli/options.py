"""Arguments and options that several commands share."""

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from lrf3d.cli.film import FilmOptions
    from lrf3d.robot.free_space import Side
    from lrf3d.scenario import Scenario


class Mode(StrEnum):
    """Modes of the mapper."""

    ROBUST = "robust"
    PAPER = "paper"


class CasterName(StrEnum):
    """Casters."""

    EMBREE = "embree"
    PLANAR = "planar"


class Renderer(StrEnum):
    """What draws a film."""

    GL = "gl"
    EMBREE = "embree"


WorldArgument = Annotated[
    str,
    typer.Argument(
        metavar="WORLD",
        help="A built-in world, or a file of one; a file called like a built-in one is ./NAME.",
    ),
]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")]
Seed = Annotated[int, typer.Option(min=0, help="Seed of the noise: the same seed, the same run.")]
Settings = Annotated[
    list[str] | None,
    typer.Option(
        "--set", metavar="TABLE.KEY=VALUE", help="Instead of what the world file says; repeatable."
    ),
]
Scale = Annotated[
    float,
    typer.Option(
        metavar="FACTOR",
        help="Enlarge the plan so many times, its route too: 100 for a drawing of 1:100, 0.001"
        " for millimetres taken as metres. Heights stay.",
    ),
]
Inside = Annotated[
    bool | None,
    typer.Option(
        "--inside/--outside",
        help="Where a route is planned if the world names none; by the world if not given.",
    ),
]
ModeOption = Annotated[Mode | None, typer.Option(help="Mode of the mapper.")]
IgnoreCollisions = Annotated[
    bool, typer.Option("--ignore-collisions", help="Only warn of a drive into a wall.")
]
Out = Annotated[
    Path | None,
    typer.Option(
        help="Folder for the results. If not given, out/NAME: what is read names itself, else its"
        " file does (a map.yaml with its folder's name before it); a map of a run goes to"
        " out/NAME_map, a sweep to out/NAME_sweep. Where that holds results of something else, a"
        " number follows; in a folder that is given they are replaced, with a warning."
    ),
]
ViewOption = Annotated[
    str | None,
    typer.Option(help="Where the film is seen from: chase, first, orbit, top, or a camera's name."),
]
Size = Annotated[
    str | None,
    typer.Option(
        metavar="WxH",
        help="Size of the film [pixels]; 1280x720, but 640x360 for .webp, .gif and by Embree.",
    ),
]
Fps = Annotated[
    float | None,
    typer.Option(min=0.1, max=1000.0, help="Frames a second of the film; 25, but 10 for .gif."),
]
RendererOption = Annotated[
    Renderer | None,
    typer.Option(help="What draws the film: OpenGL, or Embree, which needs no library."),
]
Playback = Annotated[
    float | None, typer.Option(min=0.01, help="Simulated seconds in a second of film.")
]
Samples = Annotated[int, typer.Option(help="Samples a pixel against jagged edges: 0 or 4.")]
Workers = Annotated[
    int | None,
    typer.Option(min=1, max=512, help="Processes that draw the film; one a core if not given."),
]
Scheduler = Annotated[
    str | None,
    typer.Option(metavar="tcp://HOST:PORT", help="A Dask scheduler instead of this machine."),
]


def read_world(name: str, settings: list[str] | None = None, *, scale: float = 1.0) -> "Scenario":
    """Read a world to drive through, and warn where its size is that of no world.

    Raises:
        InputError: There is no such world, or a setting or the scale is invalid.
    """
    from lrf3d.cli.console import warn
    from lrf3d.scenario import read_scenario_file, scenario_of
    from lrf3d.world.sizes import size_warning

    scenario = scenario_of(read_scenario_file(name).scaled(scale), settings or ())
    warning = size_warning(scenario.world)
    if warning is not None:
        warn(f"{name}: {warning}")
    return scenario


def read_drive(
    name: str,
    settings: list[str] | None = None,
    *,
    scale: float = 1.0,
    inside: bool | None = None,
) -> "Scenario":
    """Read a world to drive through, and plan a route where it names none.

    Raises:
        InputError: There is no such world, a setting or the scale is invalid, or there is no room
            to drive on the side of the walls that is asked for.
    """
    from lrf3d.cli.console import say
    from lrf3d.errors import InputError
    from lrf3d.study.experiment import with_route

    where = side_of(inside)
    scenario = with_route(read_world(name, settings, scale=scale), where=where)
    if scenario.planned is None and where is not None:
        raise InputError(f"--{where}: {name} names its own route or poses, so none is planned")
    if scenario.planned is not None:
        other = {"inside": "outside", "outside": "inside"}[scenario.planned]
        say(f"the route is planned {scenario.planned} the walls; --{other} plans it {other}")
    return scenario


def side_of(inside: bool | None) -> "Side | None":
    """The side of the walls that --inside or --outside asks for."""
    return None if inside is None else "inside" if inside else "outside"


def film_options(
    *,
    size: str | None,
    fps: float | None,
    playback: float | None,
    view: str | None,
    samples: int,
    workers: int | None,
    renderer: Renderer | None,
    scheduler: str | None = None,
) -> "FilmOptions":
    """What was asked for of a film, checked.

    Raises:
        InputError: A size is none.
    """
    from lrf3d.cli.film import FilmOptions

    return FilmOptions(
        size=None if size is None else parse_size(size),
        fps=fps,
        playback=playback,
        view=view,
        samples=samples,
        workers=workers,
        renderer=None if renderer is None else renderer.value,
        scheduler=scheduler,
    )


def parse_size(text: str) -> tuple[int, int]:
    """Width and height of a size written as 1280x720; both even, as H.264 has them.

    Raises:
        InputError: The text is no such size.
    """
    from lrf3d.errors import InputError

    width, _, height = text.lower().partition("x")
    if not (width.isdigit() and height.isdigit()):
        raise InputError(f"--size {text}: expected WIDTHxHEIGHT, such as 1280x720")
    size = int(width), int(height)
    if min(size) < 64 or max(size) > 7680 or size[0] % 2 or size[1] % 2:
        raise InputError(f"--size {text}: expected even numbers from 64 to 7680")
    return size
