"""Numbers of a map's objects that last while the map grows."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic_run import around, box, make_run, make_world

from lrf3d.gltf import run_glb
from lrf3d.laser import LaserRangeFinder
from lrf3d.mapping import LineMap
from lrf3d.mapping.tracking import ObjectTracker

WALLS = np.vstack([box(0, 0, 10, 6), box(14, 0, 8, 6)])


def line_map(walls, objects):
    return LineMap(np.asarray(walls, float), np.array(objects), np.full(len(objects), 9))


def test_objects_keep_their_numbers_when_the_mapper_numbers_them_anew():
    tracker = ObjectTracker()
    first = tracker.follow(line_map(WALLS[[0, 1, 4]], [0, 0, 1]))
    assert first.tolist() == [0, 0, 1]
    # A new object comes first, and all have moved a little.
    moved = WALLS[[6, 4, 0, 1, 2]] + 0.05
    assert tracker.follow(line_map(moved, [0, 1, 2, 2, 2])).tolist() == [2, 1, 0, 0, 0]


def test_of_objects_that_become_one_the_larger_gives_its_number():
    tracker = ObjectTracker()
    tracker.follow(line_map(WALLS[[1, 0, 4]], [0, 1, 2]))
    assert tracker.follow(line_map(WALLS[[0, 1, 4]], [0, 0, 1])).tolist() == [1, 1, 2]


def test_of_an_object_that_falls_apart_the_larger_part_keeps_the_number():
    tracker = ObjectTracker()
    tracker.follow(line_map(WALLS[:4], [0, 0, 0, 0]))
    numbers = tracker.follow(line_map(WALLS[:4], [0, 1, 1, 1]))
    assert numbers.tolist() == [1, 0, 0, 0]


def test_an_empty_map_in_between_takes_no_numbers():
    tracker = ObjectTracker()
    assert tracker.follow(LineMap.empty()).tolist() == []
    assert tracker.follow(line_map(WALLS[:1], [4])).tolist() == [0]


@pytest.fixture
def run():
    """A run whose map joins two parts of the first house, and numbers its objects anew."""
    done = make_run(make_world(WALLS[:4], WALLS[4:]), around(11, 3, 20, 12), LaserRangeFinder())
    stages = (2, 5, 11)
    maps = (
        line_map(WALLS[[0, 2, 4]], [0, 1, 2]),
        line_map(WALLS[[4, 5, 0, 1, 2]], [0, 0, 1, 1, 1]),
        line_map(WALLS[[4, 5, 6, 0, 1, 2, 3]], [1, 1, 1, 0, 0, 0, 0]),
    )
    return replace(done, snapshot_scans=stages, maps=maps)


def test_objects_bear_the_numbers_of_the_true_ones(run):
    first, second, last = (numbers.tolist() for numbers in run.lasting_objects)
    assert last == [1, 1, 1, 0, 0, 0, 0] and second == [1, 1, 0, 0, 0]
    # The part that was merged away has a number that no true object has.
    assert sorted(first) == [0, 1, 2] and first[2] == 1


def test_a_part_of_a_run_has_the_numbers_of_the_whole(run):
    part = run.part(np.arange(3))
    assert part.lasting_objects[-1].tolist() == run.lasting_objects[-1].tolist()


def test_all_pictures_give_an_object_one_colour_in_all_maps(run):
    from lrf3d.scene.drawn_map import DrawnMap
    from lrf3d.scene.stage.structures import Structures

    numbers = np.concatenate(run.lasting_objects)
    structures = Structures.from_run(run)
    drawn = [DrawnMap.from_snapshot(run, stage, structures) for stage in range(3)]
    rows = np.concatenate([each.colours for each in drawn])
    colours = [{*map(tuple, rows[numbers == number])} for number in np.unique(numbers)]
    assert [len(each) for each in colours] == [1, 1, 1]
    assert len(set.union(*colours)) == 3
    assert run_glb(run)[:4] == b"glTF"
