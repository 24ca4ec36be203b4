"""Arguments and options that several commands share, single or in groups."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

import typer

if TYPE_CHECKING:
    from lrf3d.cli.console import Report
    from lrf3d.planning.free_space import Side
    from lrf3d.scenario import Scenario

RUN = "A run.npz, or its folder."
WORLD = "A built-in world, or a world file; ./NAME is a file named like a built-in world."
OUT = (
    "Folder for the results; out/NAME if not given, out/NAME_map for the map of a run and"
    " out/NAME_sweep for a sweep. NAME is the name in the file, or else of the file (for a map.yaml"
    " after that of its folder)."
)
SCALE = (
    "Enlarge the plan and its route by this factor: 100 for a drawing of 1:100, 0.001 for"
    " millimetres that were read as metres. Heights stay."
)
INSIDE = "Where to plan a route if the world has none; depends on the world if not given."

WorldArgument = Annotated[str, typer.Argument(metavar="WORLD", help=WORLD)]
RunArgument = Annotated[Path, typer.Argument(metavar="RUN", help=RUN)]
Out = Annotated[Path | None, typer.Option("--out", "-o", help=OUT)]
OutFile = Annotated[Path | None, typer.Option("--out", "-o")]
Count = Annotated[int, typer.Option(min=1)]
MaybeCount = Annotated[int | None, typer.Option(min=1)]
Seed = Annotated[int, typer.Option(min=0, help="Seed; the same seed gives the same results.")]
Scale = Annotated[float, typer.Option(metavar="FACTOR", help=SCALE)]
Resolution = Annotated[
    float | None, typer.Option(help="Side of a pixel [m], if the world is a bare picture.")
]
Inside = Annotated[bool | None, typer.Option("--inside/--outside", help=INSIDE)]
IgnoreCollisions = Annotated[
    bool, typer.Option("--ignore-collisions", help="Only warn if the robot hits a wall.")
]
Mode = Literal["robust", "paper"] | None
LargestRange = Annotated[
    float | None, typer.Option(help="CARMEN: readings [m] of this or more are no return.")
]
ScanTopic = Annotated[
    str | None, typer.Option(help="Bags: topic of the scans; /scan if not given.")
]
Workers = Annotated[
    int | None,
    typer.Option(min=1, max=512, help="Number of processes; one for each core if not given."),
]


@dataclass(frozen=True)
class Drive:
    """How a world is read, and how the robot drives through it.

    Options:
        settings: Override a key of the world file; repeatable.
    """

    title: ClassVar[str | None] = "World and drive"
    settings: Annotated[list[str] | None, typer.Option("--set", metavar="TABLE.KEY=VALUE")] = None
    scale: Scale = 1.0
    resolution: Resolution = None
    inside: Inside = None
    ignore_collisions: IgnoreCollisions = False

    @property
    def on_collision(self) -> Any:
        """What is called with the message of a collision; None if it is an error."""
        from lrf3d.cli.console import warn

        return warn if self.ignore_collisions else None

    def read(self, name: str, report: "Report", *, planned: bool = True) -> "Scenario":
        """Read a world to drive through, and plan a route if it has none and needs one."""
        from lrf3d.cli.console import warn
        from lrf3d.errors import InputError

        where = side_of(self.inside)
        scenario = read_world(name, self.settings, scale=self.scale, resolution=self.resolution)
        if not planned:
            return scenario
        scenario = scenario.with_route(where=where, say=warn)
        if scenario.planned is None:
            if where is not None:
                raise InputError(
                    f"--{where}: {name} has its own route or poses, so none is planned"
                )
        elif scenario.world.free is not None:
            report.note("the route is planned in the cells that the map shows to be free")
        else:
            other = {"inside": "outside", "outside": "inside"}[scenario.planned]
            report.note(
                f"the route is planned {scenario.planned} the walls; --{other} plans it {other}"
            )
        return scenario


def read_world(
    name: str,
    settings: list[str] | None = None,
    *,
    scale: float = 1.0,
    resolution: float | None = None,
) -> "Scenario":
    """Read a world, and warn if its size is implausible."""
    from lrf3d.world.files import find_world

    # An unknown name is reported before anything else is imported, which takes a second.
    find_world(name)
    from lrf3d.cli.console import warn
    from lrf3d.scenario import read_scenario_file, scenario_of
    from lrf3d.world.size import size_warning

    scenario = scenario_of(
        read_scenario_file(name, resolution=resolution).scaled(scale), settings or ()
    )
    warning = size_warning(scenario.world)
    if warning is not None:
        warn(f"{name}: {warning}")
    return scenario


def side_of(inside: bool | None) -> "Side | None":
    """The side of the walls that --inside or --outside names."""
    return None if inside is None else "inside" if inside else "outside"
