"""Writing: whole or not at all, one writer at a time, nothing half-written left for good."""

import errno
import os
import signal
import subprocess
import sys

import pytest

from lrf3d import InputError, OutputError, output
from lrf3d.output import clear_unfinished, lock_of, locked, replacing, unfinished_folder

HOLD = """
import sys
from pathlib import Path
from lrf3d.output import lock_of, locked, replacing
target = Path(sys.argv[1])
with locked(lock_of(target), target) as lock, replacing(target) as unfinished:
    lock.note(work="half")
    unfinished.write_text("half")
    print("ready", flush=True)
    sys.stdin.read()
"""


@pytest.fixture
def killed(tmp_path):
    """A target at whose writing a process was killed, and that process's number."""
    target = tmp_path / "film.mp4"
    command = [sys.executable, "-c", HOLD, str(target)]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True) as process:
        assert process.stdout.readline() == "ready\n"
        with (
            pytest.raises(InputError, match=f"film.mp4: process {process.pid} writes here"),
            locked(lock_of(target), target),
        ):
            pass
        assert len(list(tmp_path.glob(".film.*.unfinished.mp4"))) == 1
        # What a live process has under way stays.
        clear_unfinished(tmp_path)
        assert len(list(tmp_path.glob(".film.*.unfinished.mp4"))) == 1
        process.send_signal(signal.SIGKILL)
    return target, process.pid


def test_the_lock_of_a_killed_process_is_free_and_its_note_is_read(killed):
    target, process = killed
    with locked(lock_of(target), target) as lock:
        assert lock.left == {"work": "half", "process": process, "machine": output._MACHINE}
    assert not lock_of(target).exists()


def test_the_next_writer_removes_what_a_killed_one_left(killed):
    target, _ = killed
    folder = target.parent
    (folder / ".mine.unfinished.mp4").write_text("a user's own")
    with replacing(folder / "other.txt") as unfinished:
        unfinished.write_text("whole")
    assert sorted(path.name for path in folder.iterdir()) == [
        ".film.mp4.lock",
        ".mine.unfinished.mp4",
        "other.txt",
    ]


def test_what_another_machine_left_is_removed_when_it_is_old(tmp_path):
    fresh, old = (tmp_path / f".{name}.1-1@elsewhere.unfinished.npz" for name in ("a", "b"))
    fresh.write_text("")
    old.mkdir()
    (old / "part").write_text("")
    os.utime(old, (0, 0))
    clear_unfinished(tmp_path)
    assert list(tmp_path.iterdir()) == [fresh]


def test_a_lock_is_exclusive_within_a_process_and_is_gone_afterwards(tmp_path):
    target = tmp_path / "run.npz"
    with locked(lock_of(target), target):
        with pytest.raises(InputError, match="writes here"), locked(lock_of(target), target):
            pass
    with locked(lock_of(target), target):
        pass
    assert list(tmp_path.iterdir()) == []


def test_without_locks_of_the_file_system_the_process_is_looked_for(killed, monkeypatch):
    target, _ = killed

    def none(*_):
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr(output.fcntl, "flock", none)
    with locked(lock_of(target), target):
        pass
    note = f'{{"process": {os.getppid()}, "machine": "{output._MACHINE}"}}'
    lock_of(target).write_text(note)
    with pytest.raises(InputError, match=f"process {os.getppid()} writes here"):
        locked(lock_of(target), target).__enter__()


@pytest.mark.parametrize("note", ["", "[1]", "{", '{"process": "x"}', "[" * 9999])
def test_a_damaged_lock_file_holds_nobody(tmp_path, note):
    lock_of(tmp_path / "a").write_text(note)
    with locked(lock_of(tmp_path / "a"), tmp_path / "a"):
        pass


def test_a_lock_that_cannot_be_made_is_one_line(tmp_path):
    for file, said in ((tmp_path / "no" / "a", "No such file"), (tmp_path, "Is a directory")):
        with pytest.raises(OutputError, match=said), locked(file, tmp_path):
            pass


def test_names_of_any_length_that_a_file_system_takes_can_be_written(tmp_path):
    path = tmp_path / f"{'ü' * 125}.txt"
    with replacing(path) as unfinished:
        unfinished.write_text("whole")
    assert path.read_text() == "whole"


def test_a_folder_and_a_file_are_under_way_to_one_place(tmp_path):
    with replacing(tmp_path / "a.mp4") as file, unfinished_folder(tmp_path / "a.mp4") as folder:
        (folder / "part").write_text("x")
        os.replace(folder / "part", file)
    assert [path.name for path in tmp_path.iterdir()] == ["a.mp4"]
