"""What a page is opened for: a run that was kept, or a world to drive in."""

from lrf3d.io import load_run
from lrf3d.pose import Pose, as_pose
from lrf3d.scenario import Scenario, start_of
from lrf3d.scene.moments import Scene
from lrf3d.scene.timeline import Timeline
from lrf3d.view.hand_drive import HandDrive
from lrf3d.view.server import Site
from lrf3d.view.shown import VIEWS, Driven, Played, setup_of


def run_view(path: str, playback: float | None) -> Site:
    """The site of a run that is played."""
    run = load_run(path)
    speed = run.film.playback if playback is None else playback
    timeline = Timeline(run, playback=speed)
    scene = Scene(timeline)
    setup = setup_of(scene, VIEWS, end=timeline.end - timeline.start)
    return Site(setup, scene.stage, lambda: Played(run, scene.stage, speed))


def world_view(scenario: Scenario, seed: int) -> Site:
    """The site of a world to drive in, with a route or poses to start at."""
    start = start_pose(scenario)
    drive = HandDrive(scenario, start, rng=seed)
    # The first step compiles kernels and builds search trees, so it is made before the user drives.
    drive.step(0.0)
    stage = drive.scene.stage
    views = tuple(view for view in VIEWS if view != "story")
    setup = setup_of(drive.scene, views, end=0.0)
    setup["title"] = scenario.world.name or scenario.name
    return Site(setup, stage, lambda: Driven(HandDrive(scenario, start, rng=seed, stage=stage)))


def start_pose(scenario: Scenario) -> Pose:
    """Where a scenario's robot starts."""
    if scenario.start is not None:
        return scenario.start
    if scenario.route is not None:
        return start_of(scenario.route)
    assert scenario.poses is not None
    return as_pose(scenario.poses[0])
