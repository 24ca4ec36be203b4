"""Arguments and options that several commands share."""

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from lrf3d.cli.film import FilmOptions
    from lrf3d.planning.sides import Side
    from lrf3d.scenario import Scenario


class Mode(StrEnum):
    """Modes of the mapper."""

    ROBUST = "robust"
    PAPER = "paper"


class CasterName(StrEnum):
    """Casters."""

    EMBREE = "embree"
    PLANAR = "planar"


class PointsName(StrEnum):
    """What the colour of hit points may show."""

    RANGE = "range"
    INTENSITY = "intensity"


class RendererName(StrEnum):
    """Renderers of films."""

    GL = "gl"
    EMBREE = "embree"


WorldArgument = Annotated[
    str,
    typer.Argument(
        metavar="WORLD",
        help="A built-in world, or a world file; ./NAME is a file named like a built-in world.",
    ),
]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")]
Seed = Annotated[
    int, typer.Option(min=0, help="Seed of the noise; the same seed gives the same run.")
]
Settings = Annotated[
    list[str] | None,
    typer.Option(
        "--set", metavar="TABLE.KEY=VALUE", help="Override a key of the world file; repeatable."
    ),
]
Scale = Annotated[
    float,
    typer.Option(
        metavar="FACTOR",
        help="Enlarge the plan and its route by this factor: 100 for a drawing of 1:100, 0.001 for"
        " millimetres that were read as metres. Heights stay.",
    ),
]
Inside = Annotated[
    bool | None,
    typer.Option(
        "--inside/--outside",
        help="Where to plan a route if the world has none; depends on the world if not given.",
    ),
]
ModeOption = Annotated[Mode | None, typer.Option(help="Mode of the mapper.")]
IgnoreCollisions = Annotated[
    bool, typer.Option("--ignore-collisions", help="Only warn if the robot hits a wall.")
]
Out = Annotated[
    Path | None,
    typer.Option(
        help="Folder for the results; out/NAME if not given, out/NAME_map for the map of a run and"
        " out/NAME_sweep for a sweep. NAME is the name in the file, or else of the file (for a"
        " map.yaml after that of its folder). If out/NAME holds results of something else, a"
        " number is appended; in a folder that is given they are replaced, with a warning."
    ),
]
ViewOption = Annotated[
    str | None,
    typer.Option(
        help="Camera of the film: story, chase, first, orbit, overview, top, or one of the world."
    ),
]
Size = Annotated[
    str | None,
    typer.Option(
        metavar="WxH",
        help="Size of the film [pixels]; 1280x720, but 640x360 for .webp, .gif and with Embree.",
    ),
]
Fps = Annotated[
    float | None,
    typer.Option(min=0.1, max=1000.0, help="Frames per second; 25, but 10 for .gif."),
]
RendererOption = Annotated[
    RendererName | None,
    typer.Option(
        help="Renderer of the film; embree needs no OpenGL. The best available if not given."
    ),
]
PointsBy = Annotated[
    PointsName | None,
    typer.Option(help="What the colour of hit points shows; that of the run if not given."),
]
Playback = Annotated[
    float | None, typer.Option(min=0.01, help="Simulated seconds per second of film.")
]
Samples = Annotated[int, typer.Option(help="Samples per pixel for smooth edges: 0 or 4.")]
Workers = Annotated[
    int | None,
    typer.Option(
        min=1, max=512, help="Processes that draw the film; one for each core if not given."
    ),
]


def read_world(name: str, settings: list[str] | None = None, *, scale: float = 1.0) -> "Scenario":
    """Read a world to drive through, and warn if its size is implausible.

    Raises:
        InputError: There is no such world, or a setting or the scale is invalid.
    """
    from lrf3d.cli.console import warn
    from lrf3d.laser.imperfections import losses_by_light
    from lrf3d.scenario_file import read_scenario_file, scenario_of
    from lrf3d.world.size import size_warning

    scenario = scenario_of(read_scenario_file(name).scaled(scale), settings or ())
    lost = losses_by_light(scenario.noise) if scenario.world.materials else None
    for warning in (size_warning(scenario.world), lost):
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
    """Read a world to drive through, and plan a route if it has none.

    Raises:
        InputError: There is no such world, a setting or the scale is invalid, or there is no room
            to drive on the given side of the walls.
    """
    from lrf3d.cli.console import say, warn
    from lrf3d.errors import InputError

    where = side_of(inside)
    scenario = read_world(name, settings, scale=scale).with_route(where=where, say=warn)
    if scenario.planned is None and where is not None:
        raise InputError(f"--{where}: {name} has its own route or poses, so none is planned")
    if scenario.planned is not None and scenario.world.free is not None:
        say("the route is planned in the cells that the map shows to be free")
    elif scenario.planned is not None:
        other = {"inside": "outside", "outside": "inside"}[scenario.planned]
        say(f"the route is planned {scenario.planned} the walls; --{other} plans it {other}")
    return scenario


def side_of(inside: bool | None) -> "Side | None":
    """The side of the walls that --inside or --outside names."""
    return None if inside is None else "inside" if inside else "outside"


def film_options(
    *,
    size: str | None,
    fps: float | None,
    playback: float | None,
    view: str | None,
    samples: int,
    workers: int | None,
    renderer: RendererName | None,
) -> "FilmOptions":
    """The options of a film, checked.

    Raises:
        InputError: A size is invalid.
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
    )


def parse_size(text: str) -> tuple[int, int]:
    """Width and height of a size such as 1280x720; both even, as H.264 needs them.

    Raises:
        InputError: The text is not such a size.
    """
    from lrf3d.errors import InputError

    width, _, height = text.lower().partition("x")
    if not (width.isdigit() and height.isdigit()):
        raise InputError(f"--size {text}: expected WIDTHxHEIGHT, such as 1280x720")
    size = int(width), int(height)
    if min(size) < 64 or max(size) > 7680 or size[0] % 2 or size[1] % 2:
        raise InputError(f"--size {text}: expected even numbers from 64 to 7680")
    return size
