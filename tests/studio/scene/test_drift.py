"""Odometry that drifts off an estimate, and what glass does to beams."""

from dataclasses import replace

import numpy as np
import pytest
from test_render import room_run

import lrf3d
from lrf3d.geometry.pose import compose
from lrf3d.studio.render.beside import MapBeside
from lrf3d.studio.scene.camera import Look
from lrf3d.studio.scene.drift import Drift
from lrf3d.studio.scene.glass import (
    Panes,
    at_glass,
    beams_through,
    bounced,
    some_beams,
    telling_beams,
)
from lrf3d.studio.scene.moments import Scene
from lrf3d.studio.scene.panel import panel
from lrf3d.studio.scene.stage.structures import Structures
from lrf3d.studio.scene.subject import subject_of
from lrf3d.studio.scene.timeline import Timeline, interpolated


def said(run, shot="chase", *, time=1.0):
    """The lines of a panel."""
    view = Look(np.zeros(3), np.ones(3), 1.0, shot=shot)
    return panel(run, Timeline(run).moment(time), view, 1.0).text


def drifting(closures):
    """A run round a square, whose odometry has another frame and is off by 0.1 m a scan."""
    corners = np.array([[1.0, 1.0], [3.0, 1.0], [3.0, 3.0], [1.0, 3.0], [1.0, 1.2], [1.0, 1.1]])
    poses = np.insert(interpolated(np.arange(0.0, 5.1, 0.5), np.arange(6), corners), 2, 0.0, axis=1)
    room = lrf3d.load_world("paper_room")
    run = lrf3d.simulate(room, lrf3d.Trajectory(np.arange(len(poses)), poses), rng=0)
    slipped = poses + np.arange(len(run))[:, None] * [0.0, 0.1, 0.0]
    odometry = compose(np.array([3.0, -1.0, 0.5]), slipped)
    estimate = lrf3d.EstimatedTrajectory(poses, closures=np.array(closures), odometry=odometry)
    return replace(run, estimate=estimate)


def test_odometry_alone_drifts_round_a_loop_and_what_was_hit_with_it_and_one_line_says_how_far():
    run = drifting([(0, 2), (8, 0)])
    drift = Drift.of(run, np.zeros(2))
    assert drift.loop == (0, 8) and drift.off(8.0) == pytest.approx(0.8)
    subject = subject_of(run, 1.0)
    assert (subject.since, subject.moment) == (0.0, 8.0)
    assert subject.after == "Back after 7.8 m: red shows the drift"
    assert said(run, "proof", time=8.0)[-2:] == ("━ odometry alone", "━ gap 80 cm")
    head, *_, gap = said(run, "end", time=10.0)
    assert (head, gap) == ("1.0 m of drift removed", "━ gap 1.0 m")
    # An estimate that is as far off has removed none.
    wrong = replace(run.estimate, poses=run.estimate.poses + np.array([1.0, 0.0, 0.0]))
    assert subject_of(replace(run, estimate=wrong), 1.0).found == ""
    hits = [scan.points() for scan in run.scans]
    moved = np.repeat(0.1 * np.arange(len(run)), [len(each) for each in hits])
    places = drift.points(len(run)).places
    back = places[:, :2] - moved[:, None] * [0.0, 1.0]
    assert back == pytest.approx(np.concatenate(hits), abs=1e-4)
    at_end, later = (Timeline(run).moment(time) for time in (10.0, 15.0))
    assert (drift.words(at_end, 1.0), drift.words(later, 1.0)) == ("gap 1.0 m", "")
    # Neither there and back is a loop, nor a bend, nor one that odometry alone closes, too.
    assert Drift.of(drifting([(0, 2), (0, 4)]), np.zeros(2)).loop is None
    calm = replace(run, estimate=replace(run.estimate, odometry=run.estimate.poses))
    assert subject_of(calm, 1.0).moment is None


def test_a_small_drift_is_magnified_where_the_robot_is_when_its_loop_begins():
    run = drifting([(8, 0)])
    drift = Drift.of(run, np.zeros(2))
    near = drift.alone._replace(poses=drift.believed.poses + np.array([0.0, 0.05, 0.0]))
    assert (drift.magnified, replace(drift, alone=near).magnified) == (0.0, pytest.approx(0.25))
    beside = MapBeside(Scene(Timeline(run)), (90, 90), 10.0)
    beside.magnified = 2.0, 0.5
    assert beside._window(2.0) is beside.window and not beside.frame(2.0)
    ((_, outline),) = beside.frame(9.0)
    robot = run.trajectory.poses[9, :2] - beside._scene.origin
    assert np.ptp(outline.starts[:, 0]) == pytest.approx(beside._window(9.0).width) == 0.5
    assert np.abs(outline.starts[:, :2] - robot).max() < 1.0


def test_beams_go_through_glass_or_come_back_from_it_and_panes_are_seen_at_a_slant():
    walls = [[0, 0, 4, 0], [4, 0, 4, 4], [4, 4, 0, 4], [0, 4, 0, 0], [2, 1, 2, 3]]
    world = lrf3d.World(walls, [0, 0, 0, 0, 1], materials=[None, "glass"])
    structures = Structures.from_world(world)
    ends = np.array([[4.0, 2.0], [2.01, 2.0], [1.0, 4.0]])
    through, back = at_glass(world, np.tile([1.0, 2.0], (3, 1)), ends)
    assert through.tolist() == [True, False, False] and back.tolist() == [False, True, False]
    panes = Panes.of(structures, 0.8)
    x, y = np.array([2.0, 2.0]) - structures.origin
    ahead, along = (
        panes.faces(np.array([x + dx, y + dy, 1.0]), 0.0).colours[..., 3].max()
        for dx, dy in ((-5.0, 0.0), (-0.2, -5.0))
    )
    assert along > 1.5 * ahead


def test_a_beam_that_a_mirror_turns_goes_back_and_the_laser_takes_it_to_go_on():
    walls = [[0, 0, 4, 0], [4, 0, 4, 4], [4, 4, 0, 4], [0, 4, 0, 0], [2, 1, 2, 3]]
    world = lrf3d.World(walls, [0, 0, 0, 0, 1], materials=[None, "mirror"])
    run = lrf3d.simulate(world, [(1.0, 2.0, 0.0)], noise=None, rng=0)
    (scan,) = run.scans_at(0)
    place, aim = np.array([1.0, 2.0]), np.array([4.0, 2.0])
    lines = bounced(scan, np.array(walls[4:], float), place, aim, 0.3)
    ways = np.hstack([lines.starts[:, :2], lines.ends[:, :2]])
    assert ways == pytest.approx(np.array([[1, 2, 2, 2], [2, 2, 0, 2], [2, 2, 4, 2]]), abs=0.05)
    assert bounced(scan, np.zeros((0, 4)), place, aim, 0.3) is None


def test_the_legend_counts_all_beams_at_glass_of_which_some_are_drawn():
    walls = [[0, 0, 4, 0], [4, 0, 4, 4], [4, 4, 0, 4], [0, 4, 0, 0], [2, 1, 2, 3]]
    world = lrf3d.World(walls, [0, 0, 0, 0, 1], materials=[None, "glass"])
    run = lrf3d.simulate(world, [(1.0, 2.0, 0.0), (1.5, 2.0, 0.0)], noise=None, rng=0)
    (scan,) = run.scans_at(0)
    starts = np.broadcast_to(scan.pose[:2], scan.points().shape)
    through, back = (int(each.sum()) for each in at_glass(world, starts, scan.points()))
    legend = " ".join(said(run, time=run.trajectory.times[0]))
    assert through + back > 50
    assert f"{through} beams through glass" in legend and f"{back} back from it" in legend
    beams = telling_beams(run, 0)
    assert [len(each.ends) for each in beams] == [through, back]
    drawn = [some_beams(np.zeros(2), each, np.zeros(2), 0.3) for each in beams]
    assert all(1 < len(lines.starts) <= 6 for lines in drawn)


@pytest.mark.parametrize(
    ("material", "beams", "title"),
    [("retro-reflector", ["back from 1 reflector"], "reflectors"), ("brick", [], "has never seen")],
)
def test_reflectors_are_the_subject_and_their_beams_are_told_from_near(material, beams, title):
    walls = [[0, 0, 4, 0], [4, 0, 4, 4], [4, 4, 0, 4], [0, 4, 0, 0], [2, 1, 2, 3]]
    world = lrf3d.World(walls, [0, 0, 0, 0, 1], materials=["brick", material])
    times = np.arange(0.0, 20.0, 2.0)
    drive = lrf3d.Trajectory(times, [(1.0, 1.0 + 0.1 * time, 0.0) for time in times])
    run = lrf3d.simulate(world, drive, noise=None, rng=0)
    subject = subject_of(run, 1.0)
    assert title in subject.title and (subject.moment is not None) == bool(beams)
    legend = " ".join(said(run, time=8.0))
    assert [each.words for each in telling_beams(run, 4)] == beams
    assert all(words in legend for words in beams)
    assert "reflector" not in " ".join(said(run, "rise", time=8.0))
    person = lrf3d.DynamicObstacle([[0, 0], [0.3, 0], [0, 0.3]], drive)
    seen = telling_beams(replace(run, obstacles=(person,)), 4)
    assert [each.words for each in seen] == beams


def test_a_reflector_of_several_walls_is_one_also_where_the_second_laser_meets_it():
    box = [[1, 1, 2, 1], [2, 1, 2, 2], [2, 2, 1, 2], [1, 2, 1, 1]]
    walls = [[-4, -4, 6, -4], *box, [-3, -3, -3, 3]]
    materials = ["brick", "retro-reflector", "retro-reflector"]
    world = lrf3d.World(walls, [0, 1, 1, 1, 1, 2], materials=materials)
    front, rear = (
        lrf3d.LaserRangeFinder(-1.6, 1.6, 181, mount=(0.0, 0.0, turn), name=name)
        for name, turn in (("front", 0.0), ("rear", np.pi))
    )
    times = np.arange(0.0, 20.0, 2.0)
    drive = lrf3d.Trajectory(times, [(0.1 * time, 0.0, 0.0) for time in times])
    run = lrf3d.simulate(world, drive, [front, rear], noise=None, rng=0)
    subject = subject_of(run, 1.0)
    assert subject.found.startswith("2 of 2 reflectors met") and len(subject.pinned) == 2
    assert [each.words for each in telling_beams(run, 4)] == ["back from 1 reflector"]


def test_a_robot_that_a_map_takes_for_a_wall_is_the_subject_from_when_it_does():
    run = room_run()
    path = lrf3d.Trajectory([0.0, 9.0], [(4.0, 3.0, 0.0)] * 2)
    other = lrf3d.DynamicObstacle([[0, 0], [1, 0], [0, 1]], path, is_robot=True)
    wrong = replace(run.map, segments=0.1 * run.map.segments + 3.0)
    assert subject_of(replace(run, obstacles=(other,)), 0.1).title.startswith("Two robots")
    last = len(run) - 1
    met = replace(run, obstacles=(other,), maps=(run.map, wrong), snapshot_scans=(0, last))
    subject = subject_of(met, 0.1)
    assert subject.moment == subject.until == run.trajectory.times[last]
    assert subject.proof.format("robot 1", "robot 2") == "Here robot 1 sees robot 2"
    # One that never comes near the false walls was not taken for them.
    afar = replace(other, path=replace(path, poses=path.poses + 1.0))
    assert subject_of(replace(met, obstacles=(afar,)), 0.1).title.startswith("Two robots")
    assert (np.abs(subject.places - 3.0) < 1.5).all()
    told = "beam that another robot stops", "beams that another robot stops"
    names = said(met)[-3:]
    assert ("━ this robot", "━ another robot") == names[:2] and names[2].endswith(told)
    assert f", {len(run.map)} false" in said(met, "end", time=run.trajectory.times[last])[0]


def test_a_false_wall_that_the_map_drops_is_the_subject_with_the_beams_that_go_through():
    run = room_run()
    wrong = replace(run.map, segments=0.1 * run.map.segments + 3.0)
    half, last = len(run) // 2, len(run) - 1
    dropped = replace(run, maps=(wrong, run.map), snapshot_scans=(0, half))
    subject = subject_of(dropped, 0.1)
    assert subject.moment == subject.until == run.trajectory.times[half]
    assert len(subject.pinned) == 1 and subject.found.startswith("All false walls are gone")
    through = beams_through(dropped, half, subject.dropped)
    assert through.words.endswith("through it") and len(through.ends)
    # Two walls have two pins, and beams go through one of them.
    apart = np.concatenate([wrong.segments, wrong.segments - [2.0, 0.0, 2.0, 0.0]])
    twice = lrf3d.LineMap(apart, *(np.tile(each, 2) for each in (wrong.objects, wrong.points)))
    both = subject_of(replace(dropped, maps=(twice, run.map)), 0.1)
    assert len(both.pinned) == 2 and np.ptp(both.dropped[:, 0]) < 1.5
    # What the film cannot reach, or what is left in the end, is no subject.
    late = replace(dropped, snapshot_scans=(0, last))
    left = replace(dropped, maps=(wrong, run.map, twice), snapshot_scans=(0, half, last))
    assert subject_of(late, 0.1).moment is None and subject_of(left, 0.1).moment is None
