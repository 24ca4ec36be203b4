"""Faults at every call of what writes: nothing is lost, nothing half-written, messages of one line.

Each piece of work is done over an older result, once for each of its calls, and that call fails:
for want of memory, or because the disk is full. What is left must be the older result or
the new one, whole, and no file, lock or descriptor besides. If no error comes out, the fault was in
cleaning up, or in a destructor, and the new result must be there.
"""

import functools
import shutil
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("resource", reason="Windows has no limits of a process")

from faults import (
    FAULTS,
    Calls,
    any_call,
    calls_within,
    contents,
    disk_full,
    room_for,
    spread,
    still_open,
)

import lrf3d
from lrf3d.cli.program import _message, _report
from lrf3d.exporting import export_run
from lrf3d.files import write_text
from lrf3d.io import journal
from lrf3d.io.run_file import save_run
from lrf3d.io.trajectory_files import save_tum

# Destructors of zip files and generators that a fault comes to are not ours.
pytestmark = pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")

LRF = lrf3d.LaserRangeFinder(beams=7, range_max=14.0)
WORLDS = [lrf3d.load_world("paper_room"), lrf3d.World([[0, 0, 4, 0], [4, 0, 4, 3], [1, 1, 2, 2]])]
POSES = np.column_stack([np.linspace(1.0, 2.0, 5), np.ones(5), np.zeros(5)])


@functools.cache
def run(which):
    return lrf3d.simulate(WORLDS[0], POSES[: 2 + which], LRF, rng=0)


def world_to(name):
    return lambda folder, which: lrf3d.save_world(WORLDS[which], folder / name)


def run_to(kind, name):
    return lambda folder, which: export_run(run(which), kind, folder / name)


WRITERS = {
    "text": lambda folder, which: write_text(folder / "a.txt", "new" if which else "old"),
    "toml": world_to("world.toml"),
    "geojson": world_to("world.geojson"),
    "ros map": world_to("map.yaml"),
    "map": lambda folder, which: lrf3d.save_map(run(which).map, folder / "map.geojson"),
    "poses": lambda folder, which: save_tum(*poses(run(which)), folder / "poses.tum"),
    "run": lambda folder, which: save_run(run(which), folder / "run.npz"),
    "carmen": run_to("carmen", "run.log.gz"),
    "mcap": run_to("mcap", "run.mcap"),
    "bag": run_to("rosbag2", "bag"),
    "glb": run_to("glb", "run.glb"),
    "film": lambda folder, which: lrf3d.render_video(
        run(which), folder / "run.mp4", size=(32, 32), fps=2, renderer="embree", workers=1
    ),
}
"""What writes: each to a folder, an older or a newer result."""

FEWEST = 40
"""Calls of a work that fail, evenly spread over all."""

SLOW = {"film": 20, "mcap": 60, "bag": 60, "glb": 12}
"""Calls that fail of works that take long. A film is drawn by another process; a bag has 160,000
calls, most of them in the serializer of messages."""


def poses(one):
    return one.trajectory.times, one.trajectory.poses


def fault_at_each_call(write, fault, folder, most):
    """Write over an older result with a fault at each call; returns the number of faults."""
    counts, made, expected = FAULTS[fault]
    new, older, place = (folder / name for name in ("new", "older", "place"))
    for which, path in ((1, new), (0, older), (0, place)):
        path.mkdir()
        write(path, which)
    before, after = contents(older), contents(new)
    assert before != after
    with Calls(counts) as calls:
        write(place, 1)
    assert contents(place) == after
    numbers = spread(calls.made, most)
    for number in numbers:
        shutil.rmtree(place)
        shutil.copytree(older, place)
        error = None
        try:
            with Calls(counts, number, made) as calls:
                write(place, 1)
        except BaseException as caught:
            error, text = type(caught), str(caught)
        # NumPy turns some errors within it into others.
        known = error in (None, expected) or "site-packages" in calls.place
        assert known, (calls.place, error)
        if expected is lrf3d.OutputError and error:
            assert "\n" not in text and str(place) in text and "No space left" in text
        left = visible(place)
        assert left == after or (error and left == before), (calls.place, sorted(left))
        assert still_open(folder) == [], calls.place
        if left != contents(place):
            # What a fault in clearing up left is cleared by the next writer.
            write(place, 1)
            assert contents(place) == after
    return len(numbers)


def visible(folder):
    """The files of a folder that a user sees, with their bytes."""
    return {name: data for name, data in contents(folder).items() if not name.startswith(".")}


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize(
    "writer", [pytest.param(w, marks=[pytest.mark.slow] * (w in SLOW)) for w in WRITERS]
)
def test_a_fault_at_any_call_leaves_the_older_file_or_the_new_one(writer, fault, tmp_path):
    if writer in ("mcap", "bag"):
        pytest.importorskip("rosbags")
    assert fault_at_each_call(WRITERS[writer], fault, tmp_path, SLOW.get(writer, FEWEST)) >= 3


@pytest.mark.parametrize("writer", [name for name in WRITERS if name not in ("film", "glb")])
def test_a_disk_that_is_full_after_some_byte_leaves_the_older_file(writer, tmp_path):
    WRITERS[writer](tmp_path, 0)
    before = contents(tmp_path)
    (tmp_path / "new").mkdir()
    WRITERS[writer](tmp_path / "new", 1)
    largest = max(len(data) for data in contents(tmp_path / "new").values() if data is not None)
    shutil.rmtree(tmp_path / "new")
    for size in spread(largest - 1, 6):
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
            raise disk_full()
        return rename(self, target)

    monkeypatch.setattr(Path, "rename", broken)
    with pytest.raises(lrf3d.OutputError, match="bag: cannot be written"):
        WRITERS["bag"](tmp_path, 1)
    assert contents(tmp_path) == before


def test_a_program_that_lacks_room_or_memory_says_what_is_kept(capsys):
    kept = "3 of 9 scans kept; go on with --resume"
    for error in (MemoryError(), disk_full(), lrf3d.OutputError("run.journal: disk full")):
        error.add_note(kept)
        _report("lrf3d", error, _message(error))
        said = capsys.readouterr().err
        assert said.count("\n") == 1 and said.endswith(f"; {kept}\n")


RECORDING = (
    "lrf3d/io/recording.py",
    "lrf3d/io/journal.py",
    "lrf3d/io/npz.py",
    "lrf3d/files.py",
    "lrf3d/interrupts.py",
)
"""Files whose calls are those of a recorder, besides those of the simulation."""


def simulation():
    noise = lrf3d.ProportionalNoise(0.1)
    return lrf3d.Simulation(WORLDS[1], POSES, LRF, noise=noise, caster="planar", rng=3)


@pytest.mark.parametrize("fault", FAULTS)
def test_a_recorder_that_fails_at_any_call_goes_on_where_it_says(fault, tmp_path, monkeypatch):
    # Each scan is flushed.
    monkeypatch.setattr(journal, "FLUSHED_EVERY", 0.0)
    counts, made, expected = FAULTS[fault]
    if counts is any_call:
        counts = calls_within(*RECORDING)
    path = tmp_path / "place" / "run.npz"
    path.parent.mkdir()
    made_again = []

    def note(done, total):
        made_again.append(done)

    steps = simulation()
    with Calls(counts) as calls:
        lrf3d.record(steps, path)
    whole = contents(path.parent)
    for number in spread(calls.made, 25):
        shutil.rmtree(path.parent)
        path.parent.mkdir()
        error, kept = None, []
        try:
            steps = simulation()
            with Calls(counts, number, made) as calls:
                lrf3d.record(steps, path)
        except BaseException as caught:
            error, text = type(caught), str(caught)
            kept = getattr(caught, "__notes__", [])
        left = contents(path.parent)
        assert error == expected or (error is None and left == whole), (calls.place, error)
        # A lock file that was not held yet is removed by the next holder.
        left.pop(".run.npz.lock", None)
        assert set(left) <= {"run.npz", "run.journal"}, calls.place
        assert left.get("run.npz") in (None, whole["run.npz"]), calls.place
        if expected is lrf3d.OutputError and error:
            assert "\n" not in text and str(path.with_suffix("")) in text
        assert still_open(tmp_path) == [], calls.place
        made_again.clear()
        lrf3d.record(simulation(), path, resume=True, progress=note)
        assert contents(path.parent) == whole, calls.place
        # Scans of which the message says that they are kept are not made again.
        if kept:
            count = int(kept[0].split()[0])
            assert kept == [f"{count} of 5 scans kept; go on with --resume"]
            assert made_again == list(range(count + 1, 6)), calls.place
