"""Opening a view: of a run that was kept, or of a world to drive in."""

from collections.abc import Callable

import numpy as np

from lrf3d.io import load_run
from lrf3d.pose import Pose, as_pose
from lrf3d.scenario import Scenario, load_scenario, start_of
from lrf3d.view.hand_drive import HandDrive
from lrf3d.view.page_data import PageScene, make_scene, pack_run
from lrf3d.view.server import Replayed, free_port, serve


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
    scene, show = run_view(what, playback) if is_run else world_view(what, seed, read)
    serve(scene, show, host=host, port=port, browser=browser, started=started)


def run_view(path: str, playback: float | None) -> tuple[PageScene, Replayed]:
    """The scene of a run, and what is played in it."""
    run = load_run(path)
    scene = make_scene(
        run.world,
        run.lrf,
        run.trajectory.poses[:, :2],
        title=run.world.name or "run",
        obstacles=run.obstacles,
    )
    block, told = pack_run(run)
    return scene, Replayed(block, told, run.film.playback if playback is None else playback)


def world_view(
    name: str, seed: int, read: Callable[[str], Scenario] | None = None
) -> tuple[PageScene, Callable[[], HandDrive]]:
    """The scene of a world, and what makes a drive in it."""
    scenario = load_scenario(name).with_route() if read is None else read(name)
    start = start_pose(scenario)
    title = scenario.world.name or scenario.name
    drive = HandDrive(scenario, start, rng=seed)
    # The first step compiles kernels and builds search trees, so it is made before the user drives.
    drive.step(0.0)
    path = np.array([start[:2]])
    scene = make_scene(scenario.world, scenario.lrf, path, title=title, obstacles=drive.obstacles)
    x, y = (path[0] - scene.setup["origin"]).tolist()
    scene.setup["start"] = {"x": x, "y": y, "theta": start.theta}
    return scene, lambda: HandDrive(scenario, start, rng=seed)


def start_pose(scenario: Scenario) -> Pose:
    """Where a scenario's robot starts."""
    if scenario.start is not None:
        return scenario.start
    if scenario.route is not None:
        return start_of(scenario.route)
    assert scenario.poses is not None
    return as_pose(scenario.poses[0])
