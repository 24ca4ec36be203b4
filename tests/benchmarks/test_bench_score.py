"""The scores that ``bench score`` prints are those of the maps and lines that it says."""

import json

import numpy as np
import pytest
from typer.testing import CliRunner

from benchmarks.__main__ import app
from benchmarks.score.benchmark import bench_score
from benchmarks.score.vertices import load_scan_sets, score_vertices
from benchmarks.score.world import CLEARANCE, random_poses
from lrf3d.casting import PlanarCaster
from lrf3d.errors import InputError
from lrf3d.laser import LaserRangeFinder
from lrf3d.world import World

FAR_AWAY = (85_000.0, 447_500.0)
HOUSES = np.array(
    [
        [[x, y], [x + 6, y], [x + 6, y + 4], [x, y + 4]]
        for x, y in ((0.0, 0.0), (12.0, 0.0), (0.0, 11.0), (12.0, 11.0))
    ]
)


def footprints(path, shift=(0.0, 0.0)):
    rings = [[*(ring + shift).tolist(), (ring[0] + shift).tolist()] for ring in HOUSES]
    features = [
        {"type": "Feature", "properties": {}, "geometry": {"type": "Polygon", "coordinates": [r]}}
        for r in rings
    ]
    data = {"type": "FeatureCollection", "units": "m", "features": features}
    path.write_text(json.dumps(data))
    return path


def scan_file(path, *, beams=61):
    """Two scans in a room of which the corners are known, and one of a kind without truth."""
    room = np.array([[-3.0, -2.0], [5.0, -2.0], [5.0, 4.0], [-3.0, 4.0]])
    caster = PlanarCaster(World(np.hstack([room, np.roll(room, -1, axis=0)])))
    lrf = LaserRangeFinder(-np.pi, np.pi - 2.0 * np.pi / beams, beams, range_max=50.0)
    poses = np.array([[0.0, 0.0, 0.3], [2.0, 1.0, -1.0]])
    ranges = caster.cast_batch(lrf, poses)
    columns = {}
    for kind, count in (("sim", 2), ("real", 1)):
        columns[f"{kind}_pose"] = poses[:count]
        columns[f"{kind}_n"] = np.full(count, beams)
        columns[f"{kind}_azimuth"] = np.tile(lrf.angles, count)
        columns[f"{kind}_range"] = ranges[:count].ravel()
        columns[f"{kind}_rlim"] = np.tile([0.05, 40.0], (count, 1))
    np.savez(path, **columns, sim_poly_n=np.array([4, 4]), sim_poly_xy=np.vstack([room, room]))
    return path


@pytest.mark.parametrize("shift", [(0.0, 0.0), FAR_AWAY])
def test_random_poses_are_off_all_walls_and_in_no_building(shift):
    walls = np.concatenate([np.hstack([ring, np.roll(ring, -1, axis=0)]) for ring in HOUSES])
    world = World(walls + np.tile(shift, 2), np.repeat(np.arange(4), 4))
    poses = random_poses(world, 50, np.random.default_rng(0))
    assert poses.shape == (50, 3) and (np.abs(poses[:, 2]) <= np.pi).all()
    for low in HOUSES[:, 0] + shift:
        # How far each pose lies outside of the box of the house, along each axis.
        beyond = np.maximum(low - poses[:, :2], poses[:, :2] - low - (6.0, 4.0))
        assert (np.hypot(*np.maximum(beyond, 0.0).T) >= CLEARANCE - 1e-6).all()


def test_a_world_without_room_is_refused():
    close = [[0, y, 5, y] for y in np.arange(0.0, 5.0, 0.5)]
    with pytest.raises(InputError, match="no room"):
        random_poses(World(np.array(close)), 5, np.random.default_rng(0))


def test_both_modes_are_scored_on_a_world_and_the_seed_repeats(tmp_path):
    path = footprints(tmp_path / "houses.geojson", FAR_AWAY)
    choice = {"seeds": 2, "poses": 40, "beams": (91,)}
    heard = []
    first = bench_score(str(path), **choice, progress=lambda *step: heard.append(step))
    again = bench_score(str(path), **choice)
    maps, same = first.as_dict()["maps"], again.as_dict()["maps"]
    assert [(row["mode"], row["seed"]) for row in maps] == [
        ("robust", 0), ("paper", 0), ("robust", 1), ("paper", 1),
    ]  # fmt: skip
    for row in maps + same:
        assert row.pop("update_s") > 0.0
    assert maps == same
    assert heard[-1] == (4, 4)
    # The poses lie in the bounds of the houses, whose outer walls nobody sees from there.
    best = maps[0]
    assert best["visible_segments"] == 8 and best["segment_f1"] > 0.9
    assert best["object_purity"] == 1.0
    report = json.loads(json.dumps(first.as_dict(), allow_nan=False))
    assert report["maps"][0]["segment_f1"] == best["segment_f1"]
    assert "purity" in first.text()


def test_single_scans_of_a_room_need_its_four_corners_and_no_more(tmp_path):
    sets = load_scan_sets(scan_file(tmp_path / "scans.npz"))
    assert [(each.kind, len(each.scans), len(each.polygons)) for each in sets] == [
        ("sim", 2, 2), ("real", 1, 0),
    ]  # fmt: skip
    three, four = score_vertices(sets[:1], [3, 5])
    assert four["most_used"] <= 5 and four["explained"] == 1.0
    assert four["ray_rmse_m"] < 0.05 and four["area_error"] < 0.02
    assert three["area_error"] > 0.1 and three["ray_rmse_m"] > four["ray_rmse_m"]
    (known_no_truth,) = score_vertices(sets[1:], [5])
    assert known_no_truth["area_error"] is None and known_no_truth["explained"] > 0.95


def test_the_command_scores_scans_and_logs_as_json(tmp_path):
    scans = scan_file(tmp_path / "scans.npz")
    line = "FLASER 181 " + " ".join(["5.00"] * 181) + " {x} 0 0 {x} 0 0 1.0 host 1.0\n"
    log = tmp_path / "drive.log"
    log.write_text("".join(line.format(x=0.5 * k) for k in range(4)))
    runner = CliRunner()
    lines = runner.invoke(app, ["score", str(scans), "--vertices", "5", "--json"])
    assert lines.exit_code == 0
    assert [entry["vertices"] for entry in json.loads(lines.stdout)["lines"]] == [5, 5]
    maps = runner.invoke(app, ["score", str(log), "--json"])
    assert maps.exit_code == 0
    assert [entry["mode"] for entry in json.loads(maps.stdout)["logs"]] == ["robust", "paper"]
    text = runner.invoke(app, ["score", str(log)])
    assert "explained" in text.stdout and "paper" in text.stdout


@pytest.mark.parametrize("content", [b"", b"no archive", None])
def test_what_is_no_file_of_scans_is_refused_by_name(tmp_path, content):
    path = tmp_path / "broken.npz"
    if content is None:
        np.savez(path, something=np.arange(3))
    else:
        path.write_bytes(content)
    with pytest.raises(InputError, match=r"broken\.npz"):
        load_scan_sets(path)
