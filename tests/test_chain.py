"""The whole chain at small size: world, drive, scans, map, film and summary, all read back."""

import json

import numpy as np
import pytest
from program import lrf3d as program

from lrf3d import load_map, load_run, load_world
from lrf3d.scene.story import CLOSING, OPENING

WORLD = """\
name = "yard"

[[object]]
name = "shed"
points = [[0, 0], [4, 0], [4, 3], [0, 3]]
closed = true
height = 3.0
colour = "#b08050"

[[object]]
name = "wall"
points = [[-4, -5], [9, -5], [9, 8]]

[robot]
route = [[-3, -2], [6, -2], [6, 5], [-3, 5]]
speed = 3.0
scan_interval = 0.2

[laser]
range_max = 20.0

[noise]
sigma = 0.03
"""


@pytest.mark.gl
def test_one_command_makes_film_map_and_summary(tmp_path):
    (tmp_path / "yard.toml").write_text(WORLD)
    words = (
        "run yard.toml --json --size 320x180 --fps 5 --playback 4 --samples 0 --workers 1 --out out"
    )
    done = program(*words.split(), cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    summary = json.loads(done.stdout)
    out = tmp_path / "out"

    run = load_run(out)
    assert np.array_equal(run.world.segments, load_world(tmp_path / "yard.toml").segments)
    assert len(run) == summary["drive"]["scans"]
    # Every true return lies on its wall.
    for index in range(0, len(run), 10):
        scan = run.true_scan(index)
        lines = run.world.lines[scan.walls[scan.hits]]
        x, y = scan.points().T
        off = x * np.cos(lines[:, 0]) + y * np.sin(lines[:, 0]) - lines[:, 1]
        assert np.abs(off).max() < 1e-9

    line_map = load_map(out / "map.geojson")
    assert np.array_equal(line_map.segments, run.map.segments)
    assert summary["buildings"]["whole"] >= 1
    assert summary["score"]["segment_f1"] > 0.8

    import av

    with av.open(str(out / summary["files"]["video"])) as film:
        stream = film.streams.video[0]
        pictures = [frame.to_ndarray(format="rgb24") for frame in film.decode(stream)]
        assert stream.codec_context.name == "h264"
    # The story opens with the whole world and ends with the finished map.
    expected = (OPENING + run.trajectory.duration / 4.0 + CLOSING) * 5.0
    assert abs(len(pictures) - expected) <= 2
    assert pictures[0].shape == (180, 320, 3)
    assert all(picture.std() > 10.0 for picture in pictures)
    assert np.abs(pictures[0].astype(int) - pictures[-1]).mean() > 3.0
    assert {path.name for path in out.iterdir()} == set(summary["files"].values())
