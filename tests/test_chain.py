"""The whole chain at small size: world, drive, scans, map, film and summary, all read back."""

import json

import av
import numpy as np
import pytest
from program import lrf3d as program
from yard import YARD

from lrf3d import load_map, load_run, load_world
from lrf3d.scene.story import CLOSING, OPENING


@pytest.mark.gl
def test_one_command_makes_film_map_and_summary(tmp_path):
    (tmp_path / "yard.toml").write_text(YARD)
    words = "run yard.toml --json --size 320x180 --fps 5 --playback 4 --samples 0 --workers 1 -o ."
    done = program(*words.split(), cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    summary = json.loads(done.stdout)

    run = load_run(tmp_path)
    assert np.array_equal(run.world.segments, load_world(tmp_path / "yard.toml").segments)
    assert len(run) == summary["drive"]["scans"]
    # Every true return lies on its wall.
    for index in range(0, len(run), 10):
        scan = run.true_scan(index)
        alpha, p = run.world.lines[scan.walls[scan.hits]].T
        x, y = scan.points().T
        assert np.abs(x * np.cos(alpha) + y * np.sin(alpha) - p).max() < 1e-9
    assert np.array_equal(load_map(tmp_path / "map.geojson").segments, run.map.segments)
    assert summary["score"]["segment_f1"] > 0.8

    with av.open(str(tmp_path / summary["files"]["video"])) as film:
        pictures = [frame.to_ndarray(format="rgb24") for frame in film.decode(video=0)]
    # The story opens with the whole world and ends with the finished map.
    expected = (OPENING + run.trajectory.duration / 4.0 + CLOSING) * 5.0
    assert abs(len(pictures) - expected) <= 2 and pictures[0].shape == (180, 320, 3)
    assert all(picture.std() > 10.0 for picture in pictures)
    assert np.abs(pictures[0].astype(int) - pictures[-1]).mean() > 3.0
    written = {path.name for path in tmp_path.iterdir()} - {"yard.toml"}
    assert written == set(summary["files"].values())
