"""Opening a view: of a run that was kept, or of a world to drive in."""

from collections.abc import Callable

from lrf3d.io import load_run
from lrf3d.pose import Pose, as_pose
from lrf3d.scenario import Scenario, load_scenario, start_of
from lrf3d.scene.moments import Scene
from lrf3d.scene.timeline import Timeline
from lrf3d.view.hand_drive import HandDrive
from lrf3d.view.server import Site, free_port, serve
from lrf3d.view.shown import VIEWS, Driven, Played, setup_of


def open_view(
    what: str,
    *,
    is_run: bool,
    host: str,
    port: int | None,
    browser: bool,
    playback: float | None,
    seed: int,
    started: Callable[[str], None],
    read: Callable[[str], Scenario] | None = None,
) -> None:
    """Show a run or a world in the browser until the program is interrupted.

    A world is read by `read` where given, with a route or poses to start at.

    Raises:
        Lrf3dError: The run or the world cannot be used, or the page cannot be served.
    """
    # A wrong address is refused before the work; which port is free is decided after it.
    free_port(host, port)
    site = run_view(what, playback) if is_run else world_view(what, seed, read)
    serve(site, host=host, port=port, browser=browser, started=started)


def run_view(path: str, playback: float | None) -> Site:
    """The site of a run that is played."""
    run = load_run(path)
    speed = run.film.playback if playback is None else playback
    timeline = Timeline(run, playback=speed)
    scene = Scene(timeline)
    setup = setup_of(scene, VIEWS, end=timeline.end - timeline.start)
    return Site.of(scene, setup, lambda: Played(run, scene.stage, speed))


def world_view(name: str, seed: int, read: Callable[[str], Scenario] | None = None) -> Site:
    """The site of a world to drive in."""
    scenario = load_scenario(name).with_route() if read is None else read(name)
    start = start_pose(scenario)
    drive = HandDrive(scenario, start, rng=seed)
    # The first step compiles kernels and builds search trees, so it is made before the user drives.
    drive.step(0.0)
    views = tuple(view for view in VIEWS if view != "story")
    setup = setup_of(drive.scene, views, end=0.0)
    setup["title"] = scenario.world.name or scenario.name

    def driven() -> Driven:
        return Driven(HandDrive(scenario, start, rng=seed, stage=drive.scene.stage))

    return Site.of(drive.scene, setup, driven)


def start_pose(scenario: Scenario) -> Pose:
    """Where a scenario's robot starts."""
    if scenario.start is not None:
        return scenario.start
    if scenario.route is not None:
        return start_of(scenario.route)
    assert scenario.poses is not None
    return as_pose(scenario.poses[0])
