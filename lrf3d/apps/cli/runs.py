"""``lrf3d render``, ``view`` and ``export``: runs as films, in the browser, for other programs."""

import sys
from argparse import Namespace
from dataclasses import replace
from pathlib import Path
from time import perf_counter
from typing import Any

from lrf3d.apps.cli.console import Console, say, warn
from lrf3d.apps.cli.folder import file_of_run
from lrf3d.apps.cli.inputs import refuse, routed
from lrf3d.apps.export import export_run, share_run
from lrf3d.base.errors import InputError, MissingLibraryError, storage
from lrf3d.base.files import replacing
from lrf3d.base.formats import by_name
from lrf3d.base.lean import load
from lrf3d.base.text import counted
from lrf3d.recordings import load_run
from lrf3d.simulation.run import Run
from lrf3d.simulation.scenario import Scenario

# Sizes [pixels] of films for players, and of films that are drawn slowly or shared.
_LARGE = (1280, 720)
_SMALL = (640, 360)

# Sizes [pixels] and frames a second of loops for READMEs: fifteen seconds take less than 3 MB.
_LOOPS = {".gif": ((416, 234), 8.0), ".webp": (_SMALL, 12.5)}


def render(run: Run, args: Namespace, console: Console) -> None:
    """Draw the film of a run, or a picture of one moment."""
    picture = args.at is not None
    if picture:
        refuse(args, "--from --to", "of a film, and --at draws a picture")
    if args.out is not None and picture != (args.out.suffix.lower() == ".png"):
        raise InputError(
            f"--out {args.out}: expected a name that ends in .png, as --at draws a picture"
            if picture
            else f"--out {args.out}: a .png is one picture; give its time with --at TIME"
        )
    if args.trajectory is not None:
        from lrf3d.apps.cli.scores import with_trajectory
        from lrf3d.recordings.formats.trajectory import load_tum

        run = with_trajectory(run, load_tum(args.trajectory))
    if args.points_by is not None:
        run = replace(run, film=replace(run.film, points_by=args.points_by))
    with file_of_run(args, "run.png" if picture else "run.mp4") as path:
        if picture:
            with replacing(path) as unfinished:
                load("lrf3d.studio.render.video:save_png")(
                    run.frame(args.at, **_look(args)), unfinished
                )
        else:
            drawn = write_film(run, path, args, console, part=(args.from_, args.to))
    if picture:
        console.print({"picture": str(path)}, [("picture", str(path))])
        return
    each = 1000 * drawn["seconds"] / max(drawn["frames"], 1)
    width, height = drawn["size"]
    by = "OpenGL" if drawn["renderer"] == "gl" else "Embree"
    console.print(
        {"video": str(path), "drawn": drawn},
        [
            ("film", str(path)),
            ("drawn", f"{counted(drawn['frames'], 'frame')} of {width}x{height}"),
            ("time", f"{drawn['seconds']:.1f} s, {each:.0f} ms each by {by}"),
        ],
    )


def write_film(
    run: Run,
    path: Path,
    args: Namespace,
    console: Console,
    **parts: Any,
) -> dict[str, Any]:
    """Write the film of a run, or of a part of it or several, and return its figures."""
    render_video = load("lrf3d.studio.render.video:render_video")
    look = _look(args)
    size, rate = _LOOPS.get(path.suffix.lower(), (look["size"], 25.0))
    look["size"] = args.size or size
    began = perf_counter()
    stamps = list[float]()
    with console.progress("film") as progress:

        def note(number: int, total: int) -> None:
            stamps.append(perf_counter())
            progress(number, total)
            before = stamps[-2:][0] - stamps[0]
            passed = stamps[-1] - stamps[0]
            time = passed * total / max(len(stamps) - 1, 1)
            # After 3 s it is known whether the film takes over 20 s; a terminal has a bar for it.
            if before <= 3.0 < passed and time > 20.0 and not sys.stderr.isatty():
                console.note(f"film: {total:,} frames, which take about {time:.0f} s")

        render_video(
            run, path, fps=args.fps or rate, workers=args.workers, progress=note, **look, **parts
        )
    return {
        "frames": len(stamps),
        "size": list(look["size"]),
        "renderer": look["renderer"],
        "seconds": perf_counter() - began,
    }


def _look(args: Namespace) -> dict[str, Any]:
    """Keyword arguments to draw any picture: with OpenGL, or else with Embree."""
    from lrf3d.studio.render.gl import require_gl

    renderer = args.renderer or "gl"
    if args.renderer is None:
        try:
            require_gl()
        except MissingLibraryError as error:
            warn(f"Embree draws instead, smaller and slower: {error}")
            renderer = "embree"
    return {
        **{name: vars(args)[name] for name in ("view", "playback", "panel", "length")},
        "samples": int(args.samples),
        "renderer": renderer,
        "size": args.size or (_LARGE if renderer == "gl" else _SMALL),
    }


def view(scenario: Scenario | None, args: Namespace, console: Console) -> None:
    """Play a run in the browser, or drive through a world by hand."""
    from lrf3d.studio.page.server import bound, run_view, serve, world_view

    def shown(address: str) -> None:
        text = f"{args.world} is shown at {address}; Ctrl-C ends it"
        console.print({"address": address}, [("view", text)])

    if args.foxglove:
        from lrf3d.ros.foxglove import PORT, serve_foxglove

        if scenario is None:
            raise InputError(
                f"--foxglove: {args.world} is a run; lrf3d export {args.world} --to mcap writes it"
                " for Foxglove"
            )
        serve_foxglove(
            routed(scenario, args, console),
            host=args.host,
            port=args.port or PORT,
            rng=args.seed,
            say=lambda level, text: console.note(text),
            started=shown,
        )
        return
    # A wrong address is refused before the work.
    with bound(args.host, args.port) as door:
        if scenario is None:
            make = run_view(load_run(args.world), args.playback)
        else:
            make = world_view(routed(scenario, args, console), args.seed)
        serve(make, door, host=args.host, browser=args.browser, started=shown)


def ros(scenario: Scenario, args: Namespace, console: Console) -> int | None:
    """Serve a robot in ROS 2; a second clock is wrong usage, and returns 2."""
    from lrf3d.ros import SecondClockError, serve

    names = ("rate", "robots", "speed_up", "give", "wheels", "cmd_timeout", "lines", "commands")
    try:
        serve(
            scenario if scenario.start else routed(scenario, args, console),
            arguments=args.ros_words,
            started=console.note,
            namespace=args.namespace or "",
            clock=not args.no_clock,
            odom_tf=not args.no_odom_tf,
            rng=args.seed,
            **{name: vars(args)[name] for name in names},
        )
    except SecondClockError as error:
        say(str(error))
        return 2
    return None


def export(run: Run, args: Namespace, console: Console) -> None:
    """Write a run for another program."""
    # The arrays of points need another name than run.npz, and folders have no ending.
    endings = {"npz": "_points.npz", "kitti": "_kitti", "rosbag2": "_bag"}
    row = by_name("export", args.to)
    ending = endings.get(args.to, row.endings[0])
    load(row.write)
    with file_of_run(args, f"run{ending}") as path:
        export_run(run, args.to, path, every=args.every)
    files = [each for each in (path, *sorted(path.rglob("*"))) if each.is_file()]
    scans = len(range(0, len(run), args.every))
    size = sum(file.stat().st_size for file in files)
    # A page has moments, not scans.
    kept = {} if args.to == "html" else {"scans": scans}
    console.print(
        {"file": str(path), "format": args.to, **kept, "bytes": size},
        [
            (args.to, str(path)),
            *((n, f"{each:,}") for n, each in kept.items()),
            ("size", storage(size)),
        ],
    )


def share(run: Run, args: Namespace, console: Console) -> None:
    """Write a run as a single web page."""
    load("lrf3d.studio.page.page_file:page_file")
    with file_of_run(args, "run.html") as path:
        every = share_run(run, path)
    size = path.stat().st_size
    kept = [("kept", f"one of {every} moments")] if every > 1 else []
    console.print(
        {"file": str(path), "every": every, "bytes": size},
        [("page", str(path)), *kept, ("size", storage(size))],
    )
