"""Cross-check: every difference of bare Embree from the exact plane gets the cause that it has."""

import json

import numpy as np
import pytest
from program import told

from lrf3d import LaserRangeFinder, World, crosscheck
from lrf3d.casting.comparison import UNEXPLAINED
from lrf3d.studio.figures.figures import draw_crosscheck
from lrf3d.world.generators import generate_city

ROOM = World(np.array([[0, 0, 10, 0], [10, 0, 10, 8], [10, 8, 0, 8], [0, 8, 0, 0.0]]))
ONE_BEAM = LaserRangeFinder(angle_min=0.0, angle_max=0.0, beams=1)
NONE = (np.inf, -1)


def aimed_at_corners(world, count=3000, seed=0):
    """Poses in a city that look by 1e-9 to 1e-5 rad beside an end of some wall."""
    rng = np.random.default_rng(seed)
    low, high = world.bounds
    places = rng.uniform(low, high, (count, 2))
    ends = world.segments.reshape(-1, 2)[rng.integers(0, 2 * len(world.segments), count)]
    to_end = ends - places
    aside = rng.choice([-1, 1], count) * 10.0 ** rng.uniform(-9, -5, count)
    return np.column_stack([places, np.arctan2(to_end[:, 1], to_end[:, 0]) + aside])


TALL, LEVEL = 2.5, 0.5


@pytest.mark.parametrize(
    ("expected", "height", "walls", "one", "other"),
    [
        # The wall ends 1e-6 m above the beam, and one caster sees it.
        ("wall end", TALL, [[5, 1e-6, 5, 3]], (5.0, 0), NONE),
        # It ends a millimetre above: float32 is no excuse.
        (UNEXPLAINED, TALL, [[5, 1e-3, 5, 3]], (5.0, 0), NONE),
        # The wall is met in its middle.
        (UNEXPLAINED, TALL, [[5, -3, 5, 1]], (5.0, 0), NONE),
        (UNEXPLAINED, TALL, [[5, -3, 5, 1]], (5.0, 0), (5.001, 0)),
        ("height", LEVEL, [[5, -3, 5, 1]], (5.0, 0), NONE),
        ("grazing", TALL, [[3, 0, 9, 0]], (3.0, 0), NONE),
        ("range limit", TALL, [[80, -3, 80, 1]], (80.0, 0), NONE),
        ("laser at a wall", TALL, [[0, -3, 0, 1]], (0.0, 0), NONE),
        # Half a metre is a fifth of the wall's height: there its two triangles meet.
        ("seam", TALL, [[5, -1, 5, 4]], (5.0, 0), NONE),
        ("corner tie", TALL, [[5, 0, 5, 3], [5, 0, 8, -1]], (5.0, 0), (5.0, 1)),
        (UNEXPLAINED, TALL, [[5, -1, 5, 3], [6, -2, 6, 4]], (5.0, 0), (6.0, 1)),
    ],
)
def test_a_difference_has_its_cause(monkeypatch, expected, height, walls, one, other):
    """Where the exact answer and that of Embree differ, for a beam along x."""
    for name, (distance, wall) in (
        ("caster.PlanarCaster.scan_batch", one),
        ("comparison.bare_scans", other),
    ):
        answer = np.array([[distance]]), np.array([[wall]])
        monkeypatch.setattr(f"lrf3d.casting.{name}", lambda *_, answer=answer: answer)
    world = World(walls, heights=[height] * len(walls))
    assert crosscheck(world, ONE_BEAM, [(0, 0, 0)]).causes == (expected,)


def test_bare_embree_differs_in_a_city_and_every_difference_is_explained():
    world = generate_city(400)
    result = crosscheck(world, ONE_BEAM, aimed_at_corners(world))
    assert result.counts["wall end"] > 10
    assert UNEXPLAINED not in result.causes
    assert result.largest_error > 1.0
    report = json.loads(json.dumps(result.as_dict(), allow_nan=False))
    assert sum(report["causes"].values()) == len(report["differences"])
    assert report["agree"] + len(report["differences"]) == report["beams"]


def test_a_world_without_walls_has_nothing_to_differ(tmp_path):
    result = crosscheck(World(np.empty((0, 4))), ONE_BEAM, np.zeros((2, 3)))
    assert result.beams == 2 and result.hits == 0 and result.causes == ()
    result = crosscheck(ROOM, ONE_BEAM, [(2, 3, 0)])
    draw_crosscheck(ROOM, ONE_BEAM, np.array([(2, 3, 0)]), result, tmp_path / "none.png")
    assert (tmp_path / "none.png").read_bytes().startswith(b"\x89PNG")


def test_the_command_draws_and_explains(tmp_path):
    picture = tmp_path / "room.png"
    # A beam along a wall, which bare Embree passes by: in the paper's own room.
    assert told("crosscheck", "paper_room", "--figure", picture)["causes"] == {"grazing": 1}
    assert picture.exists()
