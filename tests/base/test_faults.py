"""Disks that fill up: the older file or the new one is there, whole; messages have one line."""

import errno
import functools
import os
import shutil
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

import lrf3d
from lrf3d.apps.cli.program import _message, _report
from lrf3d.base.files import write_text
from lrf3d.recordings.formats import recording
from lrf3d.recordings.formats.trajectory import save_tum

resource = pytest.importorskip("resource", reason="Windows has no limits of a process")

DISK_FULL = OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
LRF = lrf3d.LaserRangeFinder(beams=7, range_max=14.0)
WORLDS = [lrf3d.load_world("paper_room"), lrf3d.World([[0, 0, 4, 0], [4, 0, 4, 3], [1, 1, 2, 2]])]
POSES = np.column_stack([np.linspace(1.0, 2.0, 5), np.ones(5), np.zeros(5)])


@functools.cache
def run(which):
    return lrf3d.simulate(WORLDS[0], POSES[: 2 + which], LRF, rng=0)


def world_to(name):
    return lambda folder, which: lrf3d.save_world(WORLDS[which], folder / name)


def run_to(kind, name):
    return lambda folder, which: lrf3d.export_run(run(which), kind, folder / name)


def poses_to(folder, which):
    drive = run(which).trajectory
    save_tum(drive.times, drive.poses, folder / "poses.tum")


def test_no_room_for_the_locks_of_processes_is_one_line(monkeypatch):
    # As in a container whose /dev/shm is full.
    def full(*_, **__):
        raise DISK_FULL

    monkeypatch.setattr("concurrent.futures.ProcessPoolExecutor", full)
    with pytest.raises(lrf3d.OutputError, match=r"/dev/shm: .*--workers 1"):
        lrf3d.sweep("paper_room", seeds=2, workers=2)


# What writes: each to a folder, an older or a newer result.
WRITERS = {
    "text": lambda folder, which: write_text(folder / "a.txt", "new" if which else "old"),
    "toml": world_to("world.toml"),
    "geojson": world_to("world.geojson"),
    "ros map": world_to("map.yaml"),
    "map": lambda folder, which: lrf3d.save_map(run(which).map, folder / "map.geojson"),
    "poses": poses_to,
    "run": lambda folder, which: lrf3d.save_run(run(which), folder / "run.npz"),
    "carmen": run_to("carmen", "run.log.gz"),
    "mcap": run_to("mcap", "run.mcap"),
    "bag": run_to("rosbag2", "bag"),
}


@contextmanager
def room_for(size):
    """Files can grow to a number of bytes; what is beyond fails, after a part of it is written."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def contents(folder):
    """All files of a folder, hidden ones too, with their bytes."""
    return {
        str(path.relative_to(folder)): path.read_bytes() if path.is_file() else None
        for path in folder.rglob("*")
    }


def sizes(largest, most):
    """Sizes of a full disk, evenly spread below a file's."""
    return sorted({*np.linspace(1, largest - 1, most).round().astype(int).tolist()})


@pytest.mark.parametrize("writer", WRITERS)
def test_a_disk_that_is_full_after_some_byte_leaves_the_older_file(writer, tmp_path):
    WRITERS[writer](tmp_path, 0)
    before = contents(tmp_path)
    (tmp_path / "new").mkdir()
    WRITERS[writer](tmp_path / "new", 1)
    largest = max(len(data) for data in contents(tmp_path / "new").values() if data is not None)
    shutil.rmtree(tmp_path / "new")
    for size in sizes(largest, 6):
        with pytest.raises(lrf3d.OutputError, match="File too large"), room_for(size):
            WRITERS[writer](tmp_path, 1)
        assert contents(tmp_path) == before


@pytest.mark.parametrize("older", [True, False])
def test_an_older_bag_stays_until_the_new_one_is_in_its_place(older, tmp_path, monkeypatch):
    pytest.importorskip("rosbags")
    if older:
        WRITERS["bag"](tmp_path, 0)
    before = contents(tmp_path)
    rename = Path.rename

    def broken(self, target):
        if target == tmp_path / "bag" and self.name == "bag":
            raise DISK_FULL
        return rename(self, target)

    monkeypatch.setattr(Path, "rename", broken)
    with pytest.raises(lrf3d.OutputError, match="bag: cannot be written"):
        WRITERS["bag"](tmp_path, 1)
    assert contents(tmp_path) == before


def test_a_program_that_lacks_room_or_memory_says_what_is_kept(capsys):
    kept = "3 of 9 scans kept; go on with --resume"
    for error in (MemoryError(), DISK_FULL, lrf3d.OutputError("run.journal: disk full")):
        error.add_note(kept)
        _report("lrf3d", error, _message(error))
        said = capsys.readouterr().err
        assert said.count("\n") == 1 and said.endswith(f"; {kept}\n")


def simulation():
    noise = lrf3d.ProportionalNoise(0.1)
    return lrf3d.Simulation(WORLDS[1], POSES, LRF, noise=noise, caster="planar", rng=3)


def test_a_recorder_whose_disk_is_full_goes_on_where_it_says(tmp_path, monkeypatch):
    # Each scan is flushed.
    monkeypatch.setattr(recording, "FLUSHED_EVERY", 0.0)
    path = tmp_path / "place" / "run.npz"
    path.parent.mkdir()
    lrf3d.record(simulation(), path)
    whole = contents(path.parent)
    for size in sizes(len(whole["run.npz"]), 12):
        shutil.rmtree(path.parent)
        path.parent.mkdir()
        with pytest.raises(lrf3d.OutputError, match=r"run\.") as caught, room_for(size):
            lrf3d.record(simulation(), path)
        assert "\n" not in str(caught.value) and set(contents(path.parent)) <= {"run.journal"}
        again = []
        note = functools.partial(lambda kept, done, _: kept.append(done), again)
        lrf3d.record(simulation(), path, resume=True, progress=note)
        assert contents(path.parent) == whole
        # Scans of which the message says that they are kept are not made again.
        for text in getattr(caught.value, "__notes__", []):
            assert again == list(range(int(text.split()[0]) + 1, 6)), text
