"""Cross-check: every difference of two casters gets the cause that it has."""

import json

import numpy as np
import pytest
from typer.testing import CliRunner

from lrf3d import EmbreeCaster, LaserRangeFinder, World
from lrf3d.casting import crosscheck
from lrf3d.casting.causes import Answers, Cause, explain
from lrf3d.casting.raw_embree import RawEmbreeCaster
from lrf3d.cli.app import app
from lrf3d.render.crosscheck_figure import draw_crosscheck
from lrf3d.world.generators import city_crossings, generate_city

ROOM = World(np.array([[0, 0, 10, 0], [10, 0, 10, 8], [10, 8, 0, 8], [0, 8, 0, 0.0]]))
ONE_BEAM = LaserRangeFinder(angle_min=0.0, angle_max=0.0, beams=1)
NONE = (np.inf, -1)


def aimed_at_corners(world, count=3000, seed=0):
    """Poses at crossings that look by 1e-9 to 1e-5 rad beside an end of some wall."""
    rng = np.random.default_rng(seed)
    poses = city_crossings(len(world.segments), count)
    ends = world.segments.reshape(-1, 2)[rng.integers(0, 2 * len(world.segments), count)]
    to_end = ends - poses[:, :2]
    aside = rng.choice([-1, 1], count) * 10.0 ** rng.uniform(-9, -5, count)
    poses[:, 2] = np.arctan2(to_end[:, 1], to_end[:, 0]) + aside
    return poses


def cause(world, origin, direction, one, other, lrf=ONE_BEAM):
    direction = np.array([direction]) / np.hypot(*direction)
    answers = [Answers(np.array([r]), np.array([w])) for r, w in (one, other)]
    (found,) = explain(world, lrf, np.array([origin], float), direction, *answers)
    return found


@pytest.mark.parametrize(
    ("expected", "wall", "origin", "one", "other"),
    [
        # The wall ends 1e-6 m above the beam, and one caster sees it.
        (Cause.WALL_END, [5, 1e-6, 5, 3], (0, 0), (5.0, 0), NONE),
        # It ends a millimetre above: float32 is no excuse.
        (Cause.UNEXPLAINED, [5, 1e-3, 5, 3], (0, 0), (5.0, 0), NONE),
        # The wall is met in its middle.
        (Cause.UNEXPLAINED, [5, -3, 5, 1], (0, 0), (5.0, 0), NONE),
        (Cause.UNEXPLAINED, [5, -3, 5, 1], (0, 0), (5.0, 0), (5.001, 0)),
        (Cause.GRAZING, [3, 0, 9, 0], (0, 0), (3.0, 0), NONE),
        (Cause.RANGE_LIMIT, [80, -3, 80, 1], (0, 0), (80.0, 0), NONE),
        (Cause.LASER_AT_WALL, [0, -3, 0, 1], (0, 0), (0.0, 0), NONE),
        # Half a metre is a fifth of the wall's height: there its two triangles meet.
        (Cause.SEAM, [5, -1, 5, 4], (0, 0), (5.0, 0), NONE),
    ],
)
def test_a_difference_at_one_wall_has_its_cause(expected, wall, origin, one, other):
    assert cause(World([wall]), origin, (1, 0), one, other) is expected


def test_two_walls_met_at_one_place_are_a_tie():
    corner = World([[5, 0, 5, 3], [5, 0, 8, -1]])
    assert cause(corner, (0, 0), (1, 0), (5.0, 0), (5.0, 1)) is Cause.CORNER_TIE
    apart = World([[5, -1, 5, 3], [6, -2, 6, 4]])
    assert cause(apart, (0, 0), (1, 0), (5.0, 0), (6.0, 1)) is Cause.UNEXPLAINED


def test_a_wall_as_high_as_the_beam_is_a_matter_of_height():
    level = World([[5, -3, 5, 1]], heights=[0.5])
    assert cause(level, (0, 0), (1, 0), (5.0, 0), NONE) is Cause.HEIGHT


def test_both_casters_agree_on_beams_aimed_at_corners():
    world = generate_city(400)
    result = crosscheck(world, ONE_BEAM, aimed_at_corners(world))
    assert result.differences == () and result.causes == {}
    assert result.largest_difference == 0.0


def test_bare_embree_differs_in_a_city_and_every_difference_is_explained():
    world = generate_city(400)
    result = crosscheck(world, ONE_BEAM, aimed_at_corners(world), raw=True)
    assert result.causes[Cause.WALL_END] > 10
    assert result.unexplained == ()
    assert result.largest_error > 1.0
    report = json.loads(json.dumps(result.as_dict(), allow_nan=False))
    assert sum(report["causes"].values()) == len(report["differences"])
    assert report["agree"] + len(report["differences"]) == report["beams"]
    assert report["compared_with"] == "raw"


def test_walls_that_differ_at_one_range_count_as_different(monkeypatch):
    truth = EmbreeCaster.scan_batch

    def renamed(self, lrf, poses):
        ranges, walls = truth(self, lrf, poses)
        walls[0, 40] = (walls[0, 40] + 1) % 4
        return ranges, walls

    monkeypatch.setattr(EmbreeCaster, "scan_batch", renamed)
    result = crosscheck(ROOM, LaserRangeFinder(), np.array([[2.0, 3.0, 0.0]]))
    assert [(one.scan, one.beam) for one in result.differences] == [(0, 40)]


HALL = World(
    [[0, 0, 10, 0], [0, 4, 10, 4], [4, 1, 4, 3], [0, 0, 0, 4], [10, 0, 10, 4]],
    range(5),
    materials=["mirror", "mirror", "glass", "brick", "plaster"],
)
IN_HALL = np.array([[2.1, 1.7, 0.3], [7.2, 2.9, 2.0]])


def test_both_casters_name_the_same_chains_of_mirrors_and_glass():
    lrf = LaserRangeFinder(-np.pi, np.pi, beams=721, range_max=40.0)
    for raw in (False, True):
        result = crosscheck(HALL, lrf, IN_HALL, raw=raw)
        assert result.beams == 1442 and result.hits > 1000 and not result.unexplained
        assert raw or not result.differences


def test_chains_that_differ_on_the_way_are_named(monkeypatch):
    truth = EmbreeCaster.chain_batch

    def renamed(self, lrf, poses):
        ranges, chains = truth(self, lrf, poses)
        turned = (chains[..., 1] >= 0) & (chains[..., 0] == 0)
        chains[turned, 0] = 1
        return ranges, chains

    monkeypatch.setattr(EmbreeCaster, "chain_batch", renamed)
    differences = crosscheck(HALL, LaserRangeFinder(), IN_HALL).differences
    assert len(differences) > 10
    for one in differences:
        assert one.planar == one.embree and one.chains[0][1:] == one.chains[1][1:]
        assert (one.chains[0][0], one.chains[1][0]) == (0, 1)
    assert differences[0].as_dict()["planar"]["chain"] == list(differences[0].chains[0])


def test_a_world_without_walls_has_nothing_to_differ():
    for raw in (False, True):
        result = crosscheck(World(np.empty((0, 4))), ONE_BEAM, np.zeros((2, 3)), raw=raw)
        assert result.beams == 2 and result.hits == 0 and not result.differences


def test_the_figure_shows_a_few_of_each_cause(tmp_path):
    world = generate_city(100)
    poses = aimed_at_corners(world)
    result = crosscheck(world, ONE_BEAM, poses, raw=True)
    for name, found in (("raw", result), ("same", crosscheck(world, ONE_BEAM, poses))):
        draw_crosscheck(world, ONE_BEAM, poses, found, tmp_path / f"{name}.png")
        assert (tmp_path / f"{name}.png").read_bytes().startswith(b"\x89PNG")


def test_the_command_draws_and_explains(tmp_path):
    picture = tmp_path / "room.png"
    arguments = ["crosscheck", "paper_room", "--raw", "--json", "--figure", str(picture)]
    done = CliRunner().invoke(app, arguments)
    assert done.exit_code == 0, done.output
    # A beam along a wall, which bare Embree passes by: in the paper's own room.
    assert json.loads(done.stdout)["causes"] == {"grazing": 1}
    assert picture.exists()


def test_a_raw_scan_has_the_walls_and_nearly_the_ranges_of_the_exact_one():
    lrf, pose = LaserRangeFinder(beams=91, range_max=7.0), (4.0, 3.0, 0.3)
    raw, exact = (caster(ROOM).cast(lrf, pose) for caster in (RawEmbreeCaster, EmbreeCaster))
    assert np.array_equal(raw.walls, exact.walls) and raw.pose == exact.pose
    assert raw.ranges == pytest.approx(exact.ranges, rel=1e-6)
    assert 0 < raw.hits.sum() < 91
