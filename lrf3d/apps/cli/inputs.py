"""Inputs of commands, read before the modules that process them, which take a second to import.

Of users' own mappers, controllers and noises only what the user names as ``module:object`` is ever
imported: nothing in a world file or a log is executed. Errors in a user's own code keep their
traceback.
"""

import sys
from argparse import Namespace
from collections.abc import Callable
from contextlib import ExitStack
from functools import partial
from importlib import import_module
from math import radians
from pathlib import Path
from typing import Any

from lrf3d.apps.cli.console import Console, warn
from lrf3d.apps.cli.kernels import start_compiling, wait_for
from lrf3d.base.errors import InputError, check_names
from lrf3d.base.files import check_ordinary
from lrf3d.base.lean import load
from lrf3d.planning import Side
from lrf3d.recordings import LaserLog, load_run
from lrf3d.recordings.reading import is_run, load_log, odometry_of
from lrf3d.simulation.run import Run
from lrf3d.simulation.scenario import Scenario, read_scenario_file, scenario_of
from lrf3d.world.cameras import check_view
from lrf3d.world.files import find_world, is_plan
from lrf3d.world.model import World, size_problem
from lrf3d.world.toml_file import WorldFile

# A map, and the log of a drive on it.
MapAndLog = tuple[Run | World, LaserLog]


def refuse(args: Namespace, flags: str, why: str) -> None:
    """Refuse options that were given and would change nothing."""
    if given := [flag for flag in flags.split() if flag in args.flags]:
        raise InputError(f"{', '.join(given)}: {why}")


def refuse_twice(args: Namespace) -> None:
    """Refuse a key of the world file that is given in two ways, of which one would be dropped."""
    keys = {
        "--sigma": "noise.sigma", "--beams": "laser.beams", "--mode": "mapper.mode",
        "--view": "film.view", "--playback": "film.playback", "--points-by": "film.points_by",
    }  # fmt: skip
    for name in ("set", "vary"):
        given = [text.partition("=")[0].strip() for text in getattr(args, name, None) or ()]
        for key in given:
            flags = [flag for flag, other in keys.items() if other == key and flag in args.flags]
            if flags or (name == "vary" and given.count(key) > 1):
                raise InputError(f"{' '.join([*flags, f'--{name} {key}'])}: given twice")


# Options of a simulated drive.
DRIVE = "--set --inside --outside --ignore-collisions"

# Options of how a world is read.
READING = "--scale --resolution --threshold --page --layers --without --cut --level --edits"


def read_world(args: Namespace) -> Scenario | None:
    """Read a world with its settings; None if none is named, or a run."""
    if args.world is None:
        return None
    if args.command == "view":
        if is_run(args.world):
            refuse(args, f"--seed {DRIVE} {READING}", f"{args.world} is a run, which is played")
            return None
        refuse(args, "--playback", f"{args.world} is a world, in which time passes as it does")
    file = read_file(args.world, **options_of(args))
    return scenario_of(file, getattr(args, "set", None) or ())


def read_filmed(args: Namespace) -> Run:
    """Read a run to draw; an unknown view is refused before a renderer is loaded."""
    run = load_run(args.run)
    check_view(args.view or run.film.view, run.world.cameras)
    return run


def read_served(args: Namespace) -> Scenario | None:
    """Read a world for ROS 2, after checking that ROS 2 is installed."""
    from lrf3d.ros.node import require_ros

    require_ros()
    return read_world(args)


def read_shown(args: Namespace) -> tuple[Scenario | None, Any]:
    """Read a world as `read_world` does, and the plan that a drawing or a picture is, once."""
    if args.world is None or not is_plan(args.world):
        return read_world(args), None
    from lrf3d.plans.reading import read_plan

    plan = read_plan(args.world, **options_of(args))
    return scenario_of(checked_size(args.world, plan.file(find_world(args.world)))), plan


def options_of(args: Namespace) -> dict[str, Any]:
    """How a file is read, as far as that was given."""
    names = "scale resolution threshold page layers without trees cut level edits".split()
    given = {name: getattr(args, name, None) for name in names}
    return {k: value for k, value in given.items() if value is not None and value is not False}


def read_file(name: str, **options: Any) -> WorldFile:
    """Read a world file, and warn if its size is implausible."""
    return checked_size(name, read_scenario_file(name, **options))


def checked_size(name: str, file: WorldFile) -> WorldFile:
    """A world file, with a warning if its size is implausible."""
    # The size of a plan is checked when it is read, also by its doors and walls.
    if not is_plan(name) and (warning := size_problem(file.world)):
        warn(f"{name}: {warning}")
    return file


def read_run_parts(args: Namespace) -> tuple[Scenario, dict[str, Any]]:
    """Read the world of a run, and import the user's own parts, by their kinds."""
    _check_run(args)
    scenario = scenario_of(read_file(args.world, **options_of(args)), args.set or ())
    check_view(args.view or scenario.film.view, scenario.world.cameras)
    if args.noise and scenario.compared:
        warn(f"{scenario.name}: --noise takes the place of its noise levels; none are compared")
        scenario = scenario.changed(compared=())
    kinds = [kind for kind in FORMS if vars(args)[kind] is not None]
    return scenario, {kind: load_plugin(kind, vars(args)[kind]) for kind in kinds}


def _check_run(args: Namespace) -> None:
    """Check that no option of a run takes the place of another one."""
    if args.controller and side_of(args):
        raise InputError("--inside, --outside: a controller drives, so no route is planned")
    if args.slam and (args.mapper or args.mode):
        raise InputError("--slam: it is a mapper itself; leave out --mapper and --mode")
    if args.noise and len(args.sigma or ()) > 1:
        raise InputError("--sigma: --noise takes its place; give one, for the mapper, or none")


def read_log(args: Namespace) -> LaserLog:
    """Read a log, for SLAM with the odometry as its poses."""
    if args.command == "slam" and args.relations is not None:
        check_ordinary(args.relations)
    poses = getattr(args, "poses", None) or odometry_of(args.log)
    mask = [(radians(first), radians(last)) for first, last in args.mask or ()]
    return load_log(
        args.log, largest_range=args.largest_range, smallest_range=args.smallest_range or 0.0,
        mask=mask, poses=poses, scan_topic=args.scan_topic, part=args.part,
        height=args.height, format=args.format,
        without_repairs=getattr(args, "without_repair", None) or (),
    )  # fmt: skip


def read_map_and_log(args: Namespace) -> Scenario | MapAndLog | None:
    """Read a world for simulated drives; or a map and a log."""
    if args.log is None:
        limits = "--largest-range --smallest-range --mask"
        logs = f"--out -o {limits} --scan-topic --height --format --part --without-repair"
        refuse(args, logs, "of a recorded drive; give a LOG")
        return read_world(args)
    drives = f"--known --strategy --seeds --sigma --position --heading --workers {DRIVE}"
    refuse(args, drives, f"of simulated drives, and {args.log} is a recorded one")
    if is_run(args.world):
        refuse(args, READING, f"{args.world} is a run")
        return load_run(args.world), read_log(args)
    return read_file(args.world, **options_of(args)).world, read_log(args)


def read_sweep(args: Namespace) -> tuple[list[WorldFile], dict[str, Any]]:
    """Read the worlds of a sweep, and import the user's own mappers, by their labels."""
    if args.merge:
        refuse(args, "--shard", "--merge makes no runs")
    files = [read_file(name) for name in args.world]
    names = args.mapper or ()
    return files, {name: load_plugin("mapper", name) if ":" in name else name for name in names}


def side_of(args: Namespace) -> Side | None:
    """The side of the walls that --inside or --outside names."""
    if args.inside and args.outside:
        raise InputError("--inside, --outside: choose one")
    return "inside" if args.inside else "outside" if args.outside else None


def on_collision(args: Namespace) -> Callable[[str], None] | None:
    """What is called with the message of a collision; None if it is an error."""
    return warn if args.ignore_collisions else None


def routed(scenario: Scenario, args: Namespace, console: Console) -> Scenario:
    """Plan a route through a world that has none and needs one."""
    where = side_of(args)
    scenario = scenario.with_route(where=where, say=warn)
    side = scenario.planned
    name = scenario.name
    if side is None and where is not None:
        raise InputError(f"--{where}: {name} has its own route or poses, so none is planned")
    if side is not None and scenario.world.free is not None:
        console.note(f"{name}: the route is planned in the cells that the map shows to be free")
    elif side is not None:
        other = "outside" if side == "inside" else "inside"
        console.note(f"{name}: the route is planned {side} the walls; --{other} plans it {other}")
    return scenario


# The method that each kind of plug-in must have, and its form.
FORMS = {
    "mapper": ("update", "a method update(scan)"),
    "controller": ("command", "a method command(time, pose, scan) -> (v, w)"),
    "noise": ("__call__", "a function of (scan, rng) that returns a scan"),
}


def load_plugin(kind: str, name: str) -> Any:
    """Find a user's object, or a class to instantiate without arguments for each run.

    The name is ``module:object``; the path of a ``.py`` file may replace the module.
    """
    module_name, _, path = name.rpartition(":")
    place = f"--{kind} {name}"
    if not (module_name and path):
        raise InputError(f"{place}: expected module:object, such as mymodule:MyClass")
    found = _imported(module_name, place)
    for part in path.split("."):
        check_names(place, [part], [each for each in dir(found) if each[0] != "_"])
        found = getattr(found, part)
    method, form = FORMS[kind]
    if not (callable(found) if method == "__call__" else hasattr(found, method)):
        raise InputError(f"{place}: expected {form}")
    return found


def _imported(module_name: str, place: str) -> Any:
    """The module of a name, or of the path of a ``.py`` file; errors name the option."""
    file = Path(f"{module_name}.py" if module_name.isidentifier() else module_name)
    is_file = file.suffix == ".py" and file.is_file()
    folder, plain = (file.resolve().parent, file.stem) if is_file else (Path.cwd(), module_name)
    # At the end, so that no file of the folder replaces an installed module.
    sys.path.append(str(folder))
    try:
        if not plain.replace(".", "").isidentifier():
            raise ModuleNotFoundError(name=plain)
        found: Any = import_module(plain)
    except ModuleNotFoundError as error:
        if not f"{plain}.".startswith(f"{error.name}."):
            raise
        raise InputError(
            f"{place}: no module or file {module_name!r} in {Path.cwd()} or installed"
        ) from None
    if is_file and Path(found.__file__ or "").resolve() != file.resolve():
        raise InputError(f"{place}: another module is called {plain}; rename the file")
    return found


def made(found: Any) -> Any:
    """The object that a user names, or a new one of the class."""
    return found() if isinstance(found, type | partial) else found


# What reads the input of a command, and the module and the function of the command, which gets it
# with the options and the console.
COMMANDS: dict[str, tuple[Callable[[Namespace], Any], str]] = {
    "run": (read_run_parts, "run:run"),
    "render": (read_filmed, "runs:render"),
    "view": (read_world, "runs:view"),
    "edit": (lambda args: None, "edit:edit"),
    "ros": (read_served, "runs:ros"),
    "score": (lambda args: load_run(args.run), "scores:score"),
    "export": (lambda args: load_run(args.run), "runs:export"),
    "share": (lambda args: load_run(args.run), "runs:share"),
    "crosscheck": (read_world, "world:crosscheck"),
    "map": (read_log, "logs:map_"),
    "slam": (read_log, "logs:slam"),
    "degrade": (read_log, "logs:degrade"),
    "localise": (read_map_and_log, "logs:localise"),
    "sweep": (read_sweep, "sweep:sweep"),
    "world show": (read_shown, "world:show"),
    "world convert": (lambda args: None, "world:convert"),
    "world generate": (lambda args: None, "world:generate"),
    "completion": (lambda args: None, "completion:completion"),
}


def start(args: Namespace) -> int | None:
    """Read the input of a command and run it; returns its exit status."""
    read, target = COMMANDS[args.command]
    # Commands that need the kernels of casting, mapping or SLAM.
    compiled = ("run", "map", "slam", "sweep", "localise")
    with ExitStack() as stack:
        console = Console(args.json, args.quiet, args.verbose, stack)
        slam = args.command == "slam" or getattr(args, "slam", None) or getattr(args, "log", None)
        planar = args.command == "sweep" or getattr(args, "caster", None) == "planar"
        parts = ["slam"] * bool(slam) + ["planar"] * planar
        compiling = start_compiling(*parts) if args.command in compiled else None
        if compiling is not None:
            stack.callback(compiling.kill)
        refuse_twice(args)
        source = read(args)
        command = load(f"lrf3d.apps.cli.{target}")
        if compiling is not None:
            with console.progress("compiling") as progress:
                wait_for(compiling, progress)
        status: int | None = command(source, args, console)
    return status
