"""Scores of maps against truth."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from synthetic_run import around, as_map, box, make_run, make_world

import lrf3d
from lrf3d.scoring import (
    adjusted_rand_index,
    buildings_seen,
    map_score,
    match_segments,
    score_map,
    seen_share,
    visible_walls,
)

ROUND = lrf3d.LaserRangeFinder(-np.pi, np.pi, 721)
WALL, NO_LENGTH = [0.0, 0.0, 4.0, 0.0], [1.0, 0.0, 1.0, 0.0]


@pytest.fixture(scope="module")
def blocks():
    """A drive around three buildings."""
    world = make_world(box(0, 0, 10, 6), box(14, 0, 8, 6), box(3, 10, 5, 5))
    return make_run(world, around(10, 6, 15, 24), ROUND, sigma=0.04)


@pytest.fixture(scope="module")
def truth(blocks):
    """Visible parts and their objects."""
    segments, walls = visible_walls(blocks)
    return segments, blocks.world.objects[walls]


# Visible walls


@pytest.mark.parametrize(
    ("outer", "rooms", "drive", "share"),
    [
        # A house with walls that have two faces; the second room is as large as the first.
        (box(-0.3, -0.3, 5.5, 5.6), [0], [(2.0, 2.0, 0.0), (3.0, 3.0, 2.0)], 1.0),
        (box(-0.3, -0.3, 10.6, 5.6), [0, 5.1], [(2.0, 2.0, 0.0), (3.0, 3.0, 2.0)], 0.5),
        (box(-0.3, -0.3, 10.6, 5.6), [0, 5.1], [(-2.0, -2.0, 0.0)], 0.5),
    ],
)
def test_the_seen_share_counts_walls_that_face_the_drive_and_unreached_rooms(
    outer, rooms, drive, share
):
    walls = np.vstack([outer, *(box(x, 0, 4.9, 5) for x in rooms)])
    assert seen_share(make_run(make_world(walls), np.array(drive), ROUND)) == pytest.approx(
        share, abs=0.03
    )


def test_visible_part_lies_between_the_outermost_returns():
    world = lrf3d.World(np.array([[-5.0, 2.0, 5.0, 2.0], [50.0, 50.0, 51.0, 50.0]]))
    lrf = lrf3d.LaserRangeFinder(np.deg2rad(45), np.deg2rad(135), 91, range_max=10.0)
    segments, walls = visible_walls(make_run(world, np.zeros((1, 3)), lrf))
    assert walls.tolist() == [0]
    np.testing.assert_allclose(segments, [[-2.0, 2.0, 2.0, 2.0]], atol=1e-12)


def test_a_part_of_half_a_metre_does_not_count():
    world = lrf3d.World(np.array([[-0.25, 2.0, 0.25, 2.0], [-0.26, -2.0, 0.26, -2.0]]))
    # Beams aimed at the very ends see all of both walls.
    ends, turns = (
        [x + s for x in (-0.25, 0.25) for s in (-0.01, 0.0, 0.01)],
        (np.pi / 2, -np.pi / 2),
    )
    poses = np.array([[x, 0.0, turn] for x in ends for turn in turns])
    _, walls = visible_walls(make_run(world, poses, lrf3d.LaserRangeFinder(0.0, 0.0, 1)))
    assert walls.tolist() == [1]


def test_images_in_mirrors_are_no_visible_parts_of_walls():
    walls = [[4, -3, 4, 3], [-2, -1, -2, 1], [-3, 2, 3, 2]]
    world = lrf3d.World(walls, range(3), materials=["mirror", "plaster", "plaster"])
    run = lrf3d.simulate(world, [(0.0, 0.0, 0.0), (0.5, 0.0, 0.0)], rng=0, caster="planar")
    parts, seen = visible_walls(run)
    # The wall behind the robot is seen in the mirror alone.
    assert (run.walls == 1).any() and seen.tolist() == [2]
    assert (np.abs(parts[0, [0, 2]]) <= 3.0).all()


# Map scores


def test_the_visible_walls_themselves_score_one(truth):
    segments, objects = truth
    shares = score_map(as_map(segments, objects), segments, objects).as_dict()
    assert shares.pop("perpendicular_rms") == pytest.approx(0.0, abs=1e-12)
    counts = {name: shares.pop(name) for name in list(shares) if name.endswith("_segments")}
    assert set(shares.values()) == {1.0} and set(counts.values()) == {12}
    assert score_map(as_map(segments), segments, objects).object_purity == 0.0


def turned(degrees):
    x, y = 0.5 * np.cos(np.deg2rad(degrees)), 0.5 * np.sin(np.deg2rad(degrees))
    return [1.0 - x, -y, 1.0 + x, y]


@pytest.mark.parametrize(
    ("found", "walls", "expected"),
    [
        # Shifted by 0.03 m, it is right; by 0.2 m it is neither right nor a match.
        ([[0.05, 0.03, 4.05, 0.03]], None, {"perpendicular_rms": 0.03, "segment_f1": 1.0}),
        ([[0.2, 0.2, 4.2, 0.2]], None, {"length_f1": 0.0, "segment_f1": 0.0}),
        # A turn of up to five degrees.
        ([turned(4.0)], None, {"length_precision": 1.0, "length_recall": 0.3}),
        ([turned(6.0)], None, {"length_f1": 0.0}),
        # Any true wall makes a sample right, visible or not.
        ([[0.0, 0.0, 8.0, 0.0]], None, {"length_precision": 0.5125}),
        ([[0.0, 0.0, 8.0, 0.0]], [[0.0, 0.0, 8.0, 0.0]], {"length_precision": 1.0}),
        # What is not there lowers the precision, and what is missing the recall.
        ([WALL, [0.0, 9.0, 4.0, 9.0]], None, {"length_precision": 0.5, "length_recall": 1.0}),
        ([WALL, [0.0, 9.0, 4.0, 9.0]], None, {"segment_precision": 0.5, "segment_recall": 1.0}),
        ([[0.0, 0.0, 2.0, 0.0]], None, {"length_recall": 0.525, "length_precision": 1.0}),
        # A wall in two lowers the segment F1 alone.
        (
            [[0.0, 0.0, 2.5, 0.0], [2.5, 0.0, 4.0, 0.0]],
            None,
            {"length_f1": 1.0, "segment_f1": 2 / 3},
        ),
        # It is found all the same, as is one whose longer part is.
        ([[0.0, 0.0, 1.9, 0.0], [1.9, 0.0, 4.0, 0.0]], None, {"found_segments": 1}),
        ([[0.0, 0.0, 1.5, 0.0]], None, {"found_segments": 0}),
        # A segment without length counts, and matches nothing.
        ([WALL, NO_LENGTH], None, {"matched_segments": 1, "segment_ratio": 2.0}),
        ([], None, {"length_f1": 0.0, "segment_f1": 0.0, "segment_ratio": 0.0}),
        ([], None, {"perpendicular_rms": None}),
    ],
)
def test_a_map_of_one_visible_wall_is_scored_by_hand(found, walls, expected):
    walls, line_map = walls if walls is None else np.array(walls), lrf3d.LineMap.empty()
    if found:
        line_map = as_map(np.array(found))
    score = score_map(line_map, np.array([WALL]), np.zeros(1), walls=walls).as_dict()
    assert {name: score[name] for name in expected} == pytest.approx(expected, abs=1e-9)


def test_empty_worlds_are_scored():
    nothing = np.empty((0, 4))
    no_world = score_map(as_map(np.array([WALL])), nothing, np.empty(0))
    assert (no_world.length_f1, no_world.as_dict()["segment_ratio"]) == (0.0, None)
    neither = score_map(lrf3d.LineMap.empty(), nothing, np.empty(0))
    assert (neither.length_f1, neither.segment_f1, neither.segment_ratio) == (1.0, 1.0, 1.0)


@given(
    angle=st.floats(-np.pi, np.pi),
    shift=st.sampled_from([(0.0, 0.0), (1e6, -1e6), (85000.0, 447500.0)]),
    flip=st.booleans(),
)
@settings(max_examples=25)
def test_scores_do_not_depend_on_where_the_world_lies(blocks, truth, angle, shift, flip):
    segments, objects = truth
    pose = lrf3d.Pose(*shift, angle)

    def moved(lines):
        ends = pose.apply(lines.reshape(-1, 2)).reshape(-1, 4)
        return ends[:, [2, 3, 0, 1]] if flip else ends

    here = score_map(blocks.map, segments, objects).as_dict()
    there_map = replace(blocks.map, segments=moved(blocks.map.segments))
    there = score_map(there_map, moved(segments), objects).as_dict()
    assert there == pytest.approx(here, abs=1e-8)


# Matching


@pytest.mark.parametrize(
    ("segment", "pairs"),
    [
        ((0.0, 0.0, 2.1, 0.0), 1), ((0.0, 0.0, 1.9, 0.0), 0), ((0.0, 0.0, 7.9, 0.0), 1),
        ((0.0, 0.0, 8.1, 0.0), 0), ((4.0, 0.14, 0.0, -0.14), 1), ((4.0, 0.16, 0.0, 0.0), 0),
    ],
)  # fmt: skip
def test_overlap_must_exceed_half_and_ends_must_lie_by_the_line(segment, pairs):
    assert len(match_segments(np.array([segment]), np.array([WALL]))) == pairs


def test_one_segment_cannot_stand_for_both_faces_of_a_thin_wall():
    faces = np.array([WALL, [4.0, 0.1, 0.0, 0.1]])
    assert match_segments(faces[1:], faces).tolist() == [[0, 1]]
    assert match_segments(faces[::-1], faces).tolist() == [[1, 0], [0, 1]]


@given(st.integers(0, 10_000))
@settings(max_examples=40)
def test_matching_finds_the_most_pairs(seed):
    rng = np.random.default_rng(seed)
    walls = np.array([WALL]) + rng.uniform(-0.6, 0.6, (4, 4)) * [1, 0.1, 1, 0.1]
    found = np.array([WALL]) + rng.uniform(-0.6, 0.6, (5, 4)) * [1, 0.3, 1, 0.3]
    pairs = match_segments(found, walls)
    assert len(np.unique(pairs[:, 0])) == len(np.unique(pairs[:, 1])) == len(pairs)
    allowed = np.array([[len(match_segments(f[None], w[None])) for w in walls] for f in found])
    most = max(
        sum(allowed[row, column] for column, row in enumerate(rows))
        for rows in itertools.permutations(range(5), 4)
    )
    assert len(pairs) == most and all(allowed[row, column] for row, column in pairs)


@pytest.mark.parametrize(
    ("first", "second", "expected"),
    [
        ([0, 0, 1, 1], [7, 7, 3, 3], 1.0),
        ([0, 0, 1, 1], [0, 1, 0, 1], -0.5),
        ([0, 0, 1, 1], [0, 0, 1, 2], 4 / 7),
        ([0, 0, 0, 1, 1, 1], [0, 0, 1, 1, 2, 2], 8 / 33),
        ([0, 0, 0], [5, 5, 5], 1.0),
        ([], [], 1.0),
    ],
)
def test_adjusted_rand_index_by_hand(first, second, expected):
    index = adjusted_rand_index(np.array(first, dtype=int), np.array(second, dtype=int))
    assert index == pytest.approx(expected, abs=1e-12)
    assert adjusted_rand_index(np.array(second), np.array(first)) == pytest.approx(index)


@pytest.mark.parametrize(
    "flaw", ["none", "split", "extra", "missing", "two objects", "shared object"]
)
def test_a_building_with_a_flaw_is_not_whole(blocks, flaw):
    segments, objects = blocks.map.segments.copy(), blocks.map.objects.copy()
    more = {"split": [*(0.5 * (segments[0, :2] + segments[0, 2:])), *segments[0, 2:]]}
    if row := {**more, "extra": [4, 2, 6, 2]}.get(flaw):
        segments, objects = np.vstack([segments, [row]]), np.append(objects, objects[0])
    if flaw == "split":
        segments[0, 2:] = row[:2]
    elif flaw == "missing":
        segments, objects = segments[1:], objects[1:]
    elif flaw == "two objects":
        objects[0] = 9
    elif flaw == "shared object":
        objects[objects == 1] = 0
    # Numbers of objects may have gaps.
    world = lrf3d.World(blocks.world.segments, 2 * blocks.world.objects)
    count = buildings_seen(replace(blocks, world=world, maps=(as_map(segments, objects),)))
    whole = {"none": 3, "shared object": 1}.get(flaw, 2)
    assert (count.buildings, count.seen_on_all_sides, count.whole) == (3, 3, whole)


def test_of_a_long_run_a_sample_of_the_scans_is_judged(monkeypatch):
    room, lrf = lrf3d.load_world("paper_room"), lrf3d.LaserRangeFinder(beams=61, range_max=14.0)
    run = lrf3d.simulate(room, [(1.0 + 0.4 * k, 1.0, 0.1 * k) for k in range(12)], lrf, rng=0)
    whole = map_score.summarise(run)
    assert "judged_scans" not in whole and map_score.judged_part(run) is run
    assert whole["score"]["length_f1"] > 0.9
    monkeypatch.setattr(map_score, "MOST_JUDGED", 5)
    some = map_score.summarise(run)
    assert some["judged_scans"] == 5
    assert (some["drive"], some["map"]) == (whole["drive"], whole["map"])
    assert (np.diff(map_score.judged_part(run).trajectory.times) > 0.0).all()
    bare = map_score.summarise(replace(run, snapshot_scans=(), maps=()))
    assert [bare[name] for name in ("map", "score", "buildings")] == [None] * 3
