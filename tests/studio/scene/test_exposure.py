"""First-seen times: light comes from measured ranges, colour from the map of the moment."""

from dataclasses import replace

import numpy as np
import pytest
from estimates import estimated
from PIL import Image
from test_render import SIZE, city_run, drawn, needs_gl, room_run, run_of

from lrf3d import LaserScan, LineMap, World
from lrf3d.studio.scene.stage.exposure import LiveExposure, expose, unexposed
from lrf3d.studio.scene.stage.structures import Structures

HALF = np.array([60.0, 60.0])


def exposed(run):
    """The times of a run, and what stands in its world."""
    structures = Structures.from_run(run)
    return expose(run, structures, -HALF, HALF), structures


def passed(shift=0.0):
    """A wall with a way past its end: what lies behind it is seen later; ranges may be wrong."""
    world = World(np.array([[4.0, -8.0, 4.0, 2.0]]), heights=[2.5])
    times = np.arange(0.0, 10.0)
    poses = np.column_stack([np.zeros(10), times, np.zeros(10)])
    run = run_of(world, times, poses, range_max=12.0)
    return replace(run, ranges=run.ranges + shift)


def test_a_place_is_seen_when_a_beam_first_passes_it_and_never_behind_a_wall():
    exposure, structures = exposed(passed())
    places = np.array([[2.0, 0.0], [6.0, -3.0], [6.0, 2.5], [-3.0, 0.0]]) - structures.origin
    times = exposure.sampled(places)
    first, surely = times["seen"], times["sure"]
    assert surely[[0, 2]] == pytest.approx(1.0) and (surely[[1, 3]] < 0.02).all()
    # A map's segment is a wall from two cells away: in larger worlds cells are larger.
    assert exposure.cell < exposure.tolerance < 2.0 * exposure.cell
    # The second is seen past the wall's end from where the robot begins to look past it.
    assert first[0] * exposure.length < 1.0 < 1.5 < 8.0
    assert 0.05 < first[2] < 0.35


def test_light_ends_at_walls_whatever_was_measured_and_lies_where_the_estimate_put_it():
    places = np.array([[3.6, 0.0], [4.6, 0.0]])
    for run in (passed(), passed(1.5)):
        exposure, structures = exposed(run)
        lit = exposure.sampled(places - structures.origin)["sure"] > 0.5
        assert lit.tolist() == [True, False]
    run = estimated(passed(), (0.0, 30.0, 0.0))
    exposure, structures = exposed(run)
    where = np.array([[2.0, 0.0], [2.0, 30.0]]) - structures.origin
    assert exposure.sampled(where)["sure"] == pytest.approx([0.0, 1.0], abs=0.02)


def test_a_beam_without_a_return_lights_its_way_unless_it_was_recorded():
    # In a recorded drive it may have met what is black or clear.
    recorded = estimated(passed(), (0.0, 0.0, 0.0))
    for run, lit in ((passed(), True), (recorded, False)):
        exposure, structures = exposed(run)
        (times,) = exposure.sampled(np.array([[3.0, 11.0]]) - structures.origin)
        assert (times["sure"] > 0.5) == lit


def test_scans_that_come_one_by_one_light_what_they_do_in_a_record():
    run = room_run()
    exposure, structures = exposed(run)
    live = LiveExposure(unexposed(structures, -HALF, HALF), structures)
    for number, time in enumerate(run.trajectory.times.tolist()):
        live.see(run.scans_at(number), time)
        assert live.fresh() is not None and live.fresh() is None
        # A robot that stands sees nothing new.
        live.see(run.scans_at(number), time)
        assert live.fresh() is None
    rng = np.random.default_rng(0)
    places = rng.uniform([0.0, 0.0], [8.0, 6.0], (500, 2)) - structures.origin
    one, other = (each.sampled(places) for each in (exposure, live.exposure))
    assert ((one["sure"] > 0.5) == (other["sure"] > 0.5)).mean() > 0.97
    seen = (one["sure"] > 0.9) & (other["sure"] > 0.9)
    late = np.abs(one["seen"][seen] * exposure.length - other["seen"][seen])
    assert seen.sum() > 100 and (late < 0.3).mean() > 0.9


@pytest.mark.parametrize("renderer", [pytest.param("gl", marks=needs_gl), "embree"])
def test_a_wall_takes_its_colour_from_the_map_of_the_moment_alone(renderer):
    run, shape = room_run(), {"view": "first", "layers": ("map",), "renderer": renderer}
    good, none = run.maps[0], LineMap.empty()
    # Alone in a map, the box would be most of it, which is pale.
    wrong = replace(good, segments=good.segments + [0.0, 0.0, 0.0, 0.0] + 1.0)
    pictures = {}
    for name, maps in {"good": (good,), "none": (none,), "wrong": (wrong,)}.items():
        pictures[name] = drawn(replace(run, maps=maps), 2.6, **shape)[:95]
    dropped = replace(run, maps=(good, none), snapshot_scans=(0, 11))
    pictures["kept"], pictures["dropped"] = (
        drawn(dropped, time, **shape)[:95] for time in (2.7, 2.76)
    )

    def apart(one, other):
        return float((np.abs(pictures[one] - pictures[other]).max(axis=2) > 12).mean())

    assert apart("good", "none") > 0.1 and apart("kept", "dropped") > 0.1
    assert apart("dropped", "none") < 0.1


@pytest.mark.parametrize("renderer", [pytest.param("gl", marks=needs_gl), "embree"])
def test_all_is_dark_before_the_first_scan_and_what_was_seen_is_bright_after(renderer):
    shape = {"view": "chase", "layers": (), "renderer": renderer, "size": SIZE}
    dark, lit = (drawn(city_run(), time, **shape)[100:, 40:-40] for time in (-1.0, 3.0))
    assert np.median(dark) < 50 and np.median(lit) > 80


@pytest.mark.parametrize(("apart", "wall", "reach"), [(1.5, 0, 7.0), (0.4, 1, 5.9), (1.5, 1, 5.5)])
def test_between_two_beams_light_ends_at_the_nearer_unless_they_meet_one_place(apart, wall, reach):
    structures = Structures.from_world(World(np.array([[9.0, -8.0, 9.0, 8.0]]), heights=[8.0]))
    exposure = unexposed(structures, np.array([-1.0, -8.0]), np.array([9.0, 8.0]))
    ranges = [5.5, 5.5 + apart]
    scan = LaserScan((0.0, 0.0, 0.0), [-0.3, 0.3], ranges, [0, wall])
    picture = Image.new("L", exposure.times.shape[::-1])
    exposure.fan(scan, np.zeros((0, 4)), picture, 1)
    rows, columns = np.nonzero(np.asarray(picture))
    away = np.hypot(*((np.array([columns, rows]).T + 0.5) * exposure.cell + exposure.corner).T)
    assert away.max() == pytest.approx(reach, abs=0.2)


def test_robots_light_one_world_each_where_and_when_it_was():
    run = city_run()
    # The other one starts later, elsewhere, for longer.
    off = [41.3, 7.7, 0.0]
    path = replace(run.trajectory, times=2.0 * run.trajectory.times + 3.0)
    other = replace(run, trajectory=replace(path, poses=path.poses + off))
    structures = Structures.from_run(run)
    # Each lights a box around its own path.
    one, two = (expose(each, structures, -HALF, HALF) for each in (run, other))
    both = one.joined(two)
    assert one.times.shape != two.times.shape != both.times.shape
    assert (one.joined(one).times == one.times).all()
    places = np.random.default_rng(1).uniform(-HALF, HALF, (9000, 2))
    mine, theirs, joint = (each.sampled(places) for each in (one, two, both))
    surely = np.maximum(mine["sure"], theirs["sure"])
    # Cells are at most half of their size aside.
    assert np.abs(joint["sure"] - surely).mean() < 0.01
    alone = (theirs["sure"] > 0.9) & (mine["sure"] < 0.1)
    seconds = two.start + two.length * theirs["seen"][alone]
    off = joint["seen"][alone] * both.length + both.start - seconds
    assert alone.sum() > 100 and np.abs(np.median(off)) < 0.05 and np.abs(off).mean() < 0.2
