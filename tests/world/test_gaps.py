import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import lrf3d
from lrf3d.world.free_cells import FreeCells
from lrf3d.world.gaps import OVERSHOOT, WIDEST, close_gaps

ROOM = np.array([[0, 0, 6, 0], [6, 0, 6, 4], [6, 4, 0, 4], [0, 4, 0, 0]], dtype=float)


def shortened(segments, first, last):
    """Segments whose ends are moved inwards by so much [m]."""
    along = segments[:, 2:] - segments[:, :2]
    along /= np.hypot(*along.T)[:, None]
    return np.hstack([segments[:, :2] + first * along, segments[:, 2:] - last * along])


@given(
    st.floats(-0.9 * OVERSHOOT, 0.99 * WIDEST),
    st.floats(-0.9 * OVERSHOOT, 0.99 * WIDEST),
    st.floats(0.0, 6.3),
    st.sampled_from([0.0, 1e5]),
)
def test_walls_meet_at_their_corners_wherever_they_ended(first, last, turn, far):
    cos, sin = np.cos(turn), np.sin(turn)
    room = (ROOM.reshape(-1, 2) @ np.array([[cos, sin], [-sin, cos]]) + far).reshape(-1, 4)
    walls, rows = close_gaps(shortened(room, first, last))
    assert walls == pytest.approx(room, abs=1e-6) and rows.tolist() == [0, 1, 2, 3]


@pytest.mark.parametrize(
    ("segments", "closed", "rows"),
    [
        # A wall that nearly reaches another.
        ([[0, 0, 6, 0], [3, 0.3, 3, 4]], [[0, 0, 6, 0], [3, 0, 3, 4]], [0, 1]),
        # A gap in a straight wall, closed by a piece of that wall.
        (
            [[0, 0, 3, 0], [3.3, 0.02, 6, 0]],
            [[0, 0, 3, 0], [3.3, 0.02, 6, 0], [3, 0, 3.3, 0.02]],
            [0, 1, 0],
        ),
        # A door, both sides of a wall, a corner too far away, and a single wall stay.
        ([[0, 0, 3, 0], [3.9, 0, 6, 0]], None, [0, 1]),
        ([[0, 0, 3, 0], [0, 0.3, 3, 0.3]], None, [0, 1]),
        ([[0, 0, 3, 0], [3.5, 0.5, 3.5, 4]], None, [0, 1]),
        ([[0, 0, 3, 0]], None, [0]),
    ],
)
def test_gaps_are_closed_and_doors_and_faces_stay(segments, closed, rows):
    walls, found = close_gaps(np.array(segments, dtype=float))
    assert walls.tolist() == (closed or segments) and found.tolist() == rows


def test_no_wall_grows_where_beams_went_through():
    segments = np.array([[0, 0, 3, 0], [3.3, 0, 6, 0], [3, 0.35, 3, 4]])
    free = FreeCells(np.ones((40, 70), dtype=np.bool_), 0.1, (0.0, -0.5, 0.0))
    assert (close_gaps(segments, free)[0] == segments).all()
    assert (
        len(close_gaps(segments)[0]) > len(segments) or (close_gaps(segments)[0] != segments).any()
    )


def test_a_map_of_a_room_is_a_world_whose_walls_are_one_object(tmp_path):
    run = lrf3d.simulate(lrf3d.World(ROOM), [(1, 2, 0), (5, 2, np.pi), (3, 2, 1.5)], rng=0)
    lrf3d.save_map(run.map, tmp_path / "map.geojson", free=run.free_cells())
    world = lrf3d.load_world(tmp_path / "map.geojson")
    assert world.object_count == 1 and len(world.segments) == 4
    assert len(np.unique(np.round(world.segments.reshape(-1, 2), 9), axis=0)) == 4
    assert (world.free.cells == run.free_cells().cells).all()
    # A caster finds no gap.
    lrf = lrf3d.LaserRangeFinder(-np.pi, np.pi, 20_001)
    assert np.isfinite(lrf3d.PlanarCaster(world).cast(lrf, (3, 2, 0)).ranges).all()


def test_an_empty_map_is_no_world(tmp_path):
    lrf3d.save_map(lrf3d.LineMap.empty(), tmp_path / "map.geojson")
    with pytest.raises(lrf3d.WorldError, match="no wall"):
        lrf3d.load_world(tmp_path / "map.geojson")
