import gzip
import json

import numpy as np
import pytest
from program import ran, told
from synthetic_run import around, box, make_run, make_world

from lrf3d import LaserRangeFinder, export_run, load_log, load_map, map_log
from lrf3d.base.errors import Lrf3dWarning
from lrf3d.scoring import score_log

BEAMS = 180


@pytest.fixture(scope="module")
def text(tmp_path_factory):
    """The scans of a drive around in a room of 10 m by 8 m with a pillar, as lines of a log."""
    world = make_world(box(0, 0, 10, 8), box(4.5, 3.5, 1, 1))
    lrf = LaserRangeFinder(-np.pi / 2, np.pi / 2 - np.pi / BEAMS, BEAMS, range_max=40.0)
    run = make_run(world, around(5, 4, 2.5, 40, heading=np.pi / 2), lrf, sigma=0.04)
    path = tmp_path_factory.mktemp("drive") / "drive.log"
    export_run(run, "carmen", path)
    messages = [line.split() for line in path.read_text().splitlines()]
    scans = [words for words in messages if words[0] == "ROBOTLASER1"]
    # As old logs have them: readings, the poses of laser and robot, and times.
    old = [[*words[8:189], *words[190:196], *words[-3:]] for words in scans]
    return "".join(" ".join(["FLASER", *words]) + "\n" for words in old)


@pytest.fixture
def log(text, written):
    return written("room.log.gz", gzip.compress(text.encode()))


def test_map_writes_its_files_and_json_is_the_only_output(log, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    summary = told("map", log)
    folder = tmp_path / "out" / "room"
    assert summary == json.loads((folder / "summary.json").read_text())
    written = {path.name for path in folder.iterdir()}
    assert written == {"map.geojson", "map.png", "summary.json"} == set(summary["files"].values())
    assert len(load_map(folder / "map.geojson")) == summary["map"]["segments"] == 8
    assert (folder / "map.png").read_bytes().startswith(b"\x89PNG")
    assert summary["score"]["explained"] > 0.99 and summary["score"]["violation"] < 0.01
    assert summary["log"] == {
        "scans": 40,
        "beams": 180,
        "bad_lines": 0,
        "first_bad_lines": [],
        "readings_not_numbers": 0,
        "notes": [],
        "poses": "as logged",
    }


def test_the_map_is_built_from_the_even_scans_alone(text, log, written):
    # What the odd scans say is moved a kilometre away: it must not get into the map.
    away = [
        line if place % 2 == 0 else " ".join([*line.split()[:182], "1000", *line.split()[183:]])
        for place, line in enumerate(text.splitlines())
    ]
    path = written("away.log", "\n".join(away))
    with pytest.warns(Lrf3dWarning, match="the poses contradict the scans"):
        mixed = map_log(load_log(path))
    assert np.array_equal(mixed.map.segments, map_log(load_log(log)).map.segments)
    assert score_log(mixed.map, load_log(path).scans[1::2]).explained == 0.0


def test_modes_and_noise_reach_the_mapper(log):
    drive = load_log(log)
    usual = map_log(drive).map.segments
    for settings in ({"mode": "paper", "sigma": 0.02}, {"sigma": 5.0}):
        assert not np.array_equal(map_log(drive, **settings).map.segments, usual)


def test_a_map_of_poses_that_drift_is_doubted(text, written, tmp_path):
    lines = [line.split() for line in text.splitlines()]
    for place, words in enumerate(lines):
        words[182] = str(float(words[182]) + 0.3 * place)
    path = written("drift.log", "\n".join(map(" ".join, lines)))
    done = ran("map", path, "--json", "--out", tmp_path / "out")
    assert "warning: the map explains only" in done.stderr


def test_a_log_of_one_scan_gives_a_map_and_no_score(text, written, tmp_path):
    path = written("one.log", "\n".join(text.splitlines()[:1]))
    assert told("map", path, "--out", tmp_path / "out", warns=True)["score"]["explained"] is None


def test_scans_may_differ_in_their_beams(text, written):
    lines = text.splitlines()
    for number in range(2, len(lines), 4):
        words = lines[number].split()
        lines[number] = " ".join(["FLASER", "90", *words[2:182:2], *words[182:]])
    log = written("mixed.log", "\n".join(lines))
    mapped = map_log(log)
    assert len(mapped.map) == 8 and mapped.lrf.beams == 180
    assert np.isneginf(mapped.ranges).any(axis=1).sum() == len(mapped) // 2
