"""Numbers of a map's objects that last while the map grows."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic_run import around, box, make_run, make_world

from lrf3d import LaserRangeFinder, LineMap
from lrf3d.mapping.tracking import ObjectTracker

WALLS = np.vstack([box(0, 0, 10, 6), box(14, 0, 8, 6)])


def line_map(walls, objects):
    return LineMap(np.asarray(walls, float), np.array(objects), np.full(len(objects), 9))


@pytest.mark.parametrize(
    ("first", "objects", "second", "others", "numbers"),
    [
        # A new object comes first, and the mapper numbers them again.
        ([0, 1, 4], [0, 0, 1], [6, 4, 0, 1, 2], [0, 1, 2, 2, 2], [2, 1, 0, 0, 0]),
        # Of objects that become one the larger gives its number; of one that falls apart the
        # larger part keeps it.
        ([1, 0, 4], [0, 1, 2], [0, 1, 4], [0, 0, 1], [1, 1, 2]),
        ([0, 1, 2, 3], [0, 0, 0, 0], [0, 1, 2, 3], [0, 1, 1, 1], [1, 0, 0, 0]),
        ([], [], [0], [4], [0]),
    ],
)
@pytest.mark.parametrize("shift", [0.0, 0.05])
def test_objects_keep_their_numbers(first, objects, second, others, numbers, shift):
    tracker = ObjectTracker()
    tracker.follow(line_map(WALLS[first], objects) if first else LineMap.empty())
    assert tracker.follow(line_map(WALLS[second] + shift, others)).tolist() == numbers


@pytest.fixture
def run():
    """A run whose map joins two parts of the first house, and numbers its objects again."""
    done = make_run(make_world(WALLS[:4], WALLS[4:]), around(11, 3, 20, 12), LaserRangeFinder())
    maps = (
        line_map(WALLS[[0, 2, 4]], [0, 1, 2]),
        line_map(WALLS[[4, 5, 0, 1, 2]], [0, 0, 1, 1, 1]),
        line_map(WALLS[[4, 5, 6, 0, 1, 2, 3]], [1, 1, 1, 0, 0, 0, 0]),
    )
    return replace(done, snapshot_scans=(2, 5, 11), maps=maps)


def test_objects_bear_the_numbers_of_the_true_ones_also_in_a_part_of_the_run(run):
    first, second, last = (numbers.tolist() for numbers in run.lasting_objects)
    assert last == [1, 1, 1, 0, 0, 0, 0] and second == [1, 1, 0, 0, 0]
    # The part that was merged away has a number that no true object has.
    assert sorted(first) == [0, 1, 2] and first[2] == 1
    assert run.part(np.arange(3)).lasting_objects[-1].tolist() == last


def test_films_colour_walls_from_the_first_found_to_the_last_in_all_maps(run):
    from lrf3d.studio.scene.marks import DrawnMap
    from lrf3d.studio.scene.stage.stage import stage_of

    structures, *_, exposure, _ = stage_of(run)
    first, _, last = (
        DrawnMap.from_snapshot(run, number, structures, exposure).colours for number in range(3)
    )
    # Lilac is first, yellow last.
    assert first == pytest.approx(last[[3, 5, 0]])
    assert last[[2, 6], 2].max() < last[[0, 3, 5], 2].min()
