"""Runs that are recorded scan by scan, stopped anywhere and resumed."""

import os
import signal
import subprocess
import sys

import numpy as np
import pytest
from stops import record_up_to, stopping

import lrf3d
from lrf3d import InputError, LaserRangeFinder, LineMapper, OutputError, World
from lrf3d.recordings.formats import recording
from lrf3d.slam import SlamMapper
from lrf3d.slam.simulated import COVARIANCE_INTERVAL

ROOM = World(
    [[0, 0, 10, 0], [10, 0, 10, 8], [10, 8, 0, 8], [0, 8, 0, 0], [4, 3, 6, 3], [6, 3, 6, 4]]
)
LRF = LaserRangeFinder(beams=61, range_max=20.0)
SCANS = 400
PLACES = np.linspace(0.0, 10.0 * np.pi, SCANS)
POSES = np.column_stack(
    [5.0 + 3.0 * np.cos(PLACES), 5.5 + 1.5 * np.sin(PLACES), PLACES + np.pi / 2]
)


class Sweeping:
    """A controller with a memory: it turns as it has seen more on the left or on the right."""

    def __init__(self, scans=SCANS):
        self.balance, self.left = 0.0, scans

    def command(self, time, pose, scan):
        ranges = np.minimum(scan.ranges, 20.0)
        self.balance = 0.9 * self.balance + 0.01 * (ranges[31:].sum() - ranges[:30].sum())
        self.left -= 1
        return (0.2, self.balance) if self.left else None


def simulation(mode="robust", drive=POSES, scans=None, mapper=None, **settings):
    mapper = LineMapper(mode, sigma=0.1) if mapper is None else mapper
    settings |= {"noise": lrf3d.ProportionalNoise(0.1), "mapper": mapper, "scans": scans}
    return lrf3d.Simulation(ROOM, drive, LRF, rng=7, **settings)


@pytest.fixture
def path(tmp_path):
    """Where a run is recorded."""
    return tmp_path / "run.npz"


@pytest.mark.parametrize("mode", ["robust", pytest.param("paper", marks=pytest.mark.slow)])
def test_a_run_stopped_anywhere_and_resumed_is_the_undisturbed_one(mode, path, tmp_path):
    scans = SCANS if mode == "robust" else 300
    lrf3d.record(simulation(mode, scans=scans), tmp_path / "whole.npz")
    whole = (tmp_path / "whole.npz").read_bytes()
    for at in (1, 97, 98, scans // 3, scans // 2, scans - 1, scans):
        record_up_to(at, simulation(mode, scans=scans), path, resume=True)
        assert not path.exists() and path.with_suffix(".journal").exists()
    lrf3d.record(simulation(mode, scans=scans), path, resume=True)
    assert path.read_bytes() == whole
    assert sorted(file.name for file in tmp_path.iterdir()) == ["run.npz", "whole.npz"]


@pytest.mark.slow
def test_a_controller_and_a_mapper_get_the_recorded_scans_again(path, tmp_path):
    class Plain:
        """A mapper with nothing but an update that returns a LineMap."""

        def __init__(self):
            self.inner = LineMapper(sigma=0.1)

        def update(self, scan):
            return self.inner.update(scan)

    def made():
        start = (5.0, 6.0, 0.0)
        return simulation(
            drive=Sweeping(), mapper=Plain(), scans=400, start=start, scan_interval=0.1
        )

    lrf3d.record(made(), tmp_path / "whole.npz")
    for at in (150, 333):
        record_up_to(at, made(), path, resume=True)
    run = lrf3d.record(made(), path, resume=True)
    assert path.read_bytes() == (tmp_path / "whole.npz").read_bytes()
    assert np.ptp(run.trajectory.poses[:, 2]) > 0.1


def test_a_drive_that_its_controller_ends_early_is_whole(tmp_path):
    # Not after a scan at which a map is kept anyway.
    def made():
        return simulation(drive=Sweeping(scans=44), scans=1000, start=(5.0, 6.0, 0.0))

    run = lrf3d.record(made(), tmp_path / "run.npz")
    assert len(run) == 44 and run.snapshot_scans[-2:] == (39, 43) and len(run.map)
    before = (tmp_path / "run.npz").read_bytes()
    (tmp_path / "run.npz").unlink()
    record_up_to(40, made(), tmp_path / "run.npz")
    lrf3d.record(made(), tmp_path / "run.npz", resume=True)
    assert (tmp_path / "run.npz").read_bytes() == before


@pytest.fixture(scope="module")
def stopped(tmp_path_factory):
    """A whole run of 60 scans, the journal of one that was stopped after 55, and its row's size."""
    folder = tmp_path_factory.mktemp("stopped")
    lrf3d.record(simulation(scans=60), folder / "whole.npz")
    record_up_to(55, simulation(scans=60), folder / "run.npz")
    data = (folder / "run.journal").read_bytes()
    return (folder / "whole.npz").read_bytes(), data, (len(data) - data.index(b"\n") - 1) // 55


@pytest.mark.parametrize("scans_left", [0, 1, 37, 54])
@pytest.mark.parametrize(
    "damage", ["cut within a row", "zeros", "no end", "something else", "no pose"]
)
def test_a_damaged_journal_is_valid_up_to_the_damage(damage, scans_left, stopped, path):
    whole, data, row = stopped
    place = len(data) - (55 - scans_left) * row
    rest = {"cut within a row": data[place:][: row // 2], "zeros": bytes(3 * row)}
    rest["no end"] = data[place:][: row // 2] + bytes(row)
    rest["no pose"] = data[place:][:16] + np.full(3, np.nan).tobytes() + data[place + 40 :]
    path.with_suffix(".journal").write_bytes(
        data[:place] + rest.get(damage, b"something else" * row)
    )
    made = []
    lrf3d.record(
        simulation(scans=60), path, resume=True, progress=lambda done, _: made.append(done)
    )
    assert made[0] == scans_left + 1
    assert path.read_bytes() == whole


@pytest.mark.parametrize("state", [b"{", b"{}", b"[]", b"\xff", b'{"bit_generator": "PCG64"}'])
def test_a_journal_with_an_invalid_state_of_the_random_numbers_is_refused(
    state, stopped, written, tmp_path
):
    _, data, _ = stopped
    written("run.journal", data[: -recording.RNG_BYTES] + state.ljust(recording.RNG_BYTES, b"\0"))
    with pytest.raises(InputError, match=r"run\.journal: .* after scan 55 .*leave out --resume"):
        lrf3d.record(simulation(scans=60), tmp_path / "run.npz", resume=True)


def test_a_file_that_is_no_journal_is_begun_again(tmp_path):
    (tmp_path / "run.journal").write_bytes(b'{"a":' * 10_000)
    assert len(lrf3d.record(simulation(scans=3), tmp_path / "run.npz", resume=True)) == 3


def test_another_run_is_not_resumed_and_its_difference_is_named(path):
    record_up_to(150, simulation(scans=200), path)
    for other, name in (("paper", "mapper"), ("robust", "scans")):
        with pytest.raises(InputError, match=f"whose {name} differ"):
            lrf3d.record(simulation(other, scans=200 + (name == "scans")), path, resume=True)
    assert len(lrf3d.record(simulation(scans=201), path)) == 201


def test_a_finished_run_is_not_run_again(path):
    lrf3d.record(simulation(scans=50), path)

    class Never:
        def update(self, scan):
            raise AssertionError

        def __repr__(self):
            return repr(LineMapper(sigma=0.1))

    Never.__module__, Never.__qualname__ = LineMapper.__module__, LineMapper.__qualname__
    assert len(lrf3d.record(simulation(scans=50, mapper=Never()), path, resume=True)) == 50


def test_large_arrays_are_mapped_aligned_and_the_same(tmp_path, monkeypatch):
    run = lrf3d.record(simulation(scans=300), tmp_path / "run.npz")
    monkeypatch.setattr("lrf3d.recordings.formats.npz.MAPPED", 1000)
    mapped = lrf3d.load_run(tmp_path)
    for name in ("ranges", "truth", "walls"):
        array = getattr(mapped, name)
        assert isinstance(array.base, np.memmap) and array.flags.aligned
        assert array.ctypes.data % 64 == 0
        assert np.array_equal(array, getattr(run, name))
    with np.load(tmp_path / "run.npz") as plain:
        assert np.array_equal(plain["ranges"], run.ranges)


def test_a_drive_without_an_end_needs_a_number_of_scans(tmp_path):
    endless = simulation(drive=Sweeping(), start=(5.0, 6.0, 0.0))
    with pytest.raises(InputError, match="scans"):
        lrf3d.record(endless, tmp_path / "run.npz")
    assert list(tmp_path.iterdir()) == []


KILLED = """
import sys, lrf3d
sys.path = {path!r}
import test_recording
test_recording.recording.FLUSHED_EVERY = 0.0
def progress(done, total):
    print(done, flush=True)
    if done == test_recording.SCANS - 1:
        sys.stdin.read()
lrf3d.record(test_recording.simulation(), sys.argv[1], resume=True, progress=progress)
"""


@pytest.mark.slow
def test_a_killed_process_loses_next_to_nothing(path, tmp_path):
    lrf3d.record(simulation(scans=SCANS), tmp_path / "whole.npz")
    code = KILLED.format(path=[os.path.dirname(__file__), *sys.path])
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    with subprocess.Popen([sys.executable, "-c", code, path], text=True, **pipes) as process:
        for line in process.stdout:
            if int(line) >= 200:
                process.send_signal(signal.SIGKILL)
                break
    assert process.returncode == -signal.SIGKILL
    resumed = []
    lrf3d.record(
        simulation(scans=SCANS), path, resume=True, progress=lambda done, _: resumed.append(done)
    )
    assert 200 <= resumed[0] < SCANS
    assert path.read_bytes() == (tmp_path / "whole.npz").read_bytes()


def test_one_file_has_one_writer(path, tmp_path):

    def another(done, total):
        if done == 2:
            with pytest.raises(InputError, match=r"run\.npz: another process writes here"):
                lrf3d.record(simulation(scans=9), path)

    lrf3d.record(simulation(scans=5), path, progress=another)
    assert len(lrf3d.load_run(path)) == 5
    assert [file.name for file in tmp_path.iterdir()] == ["run.npz"]


@pytest.mark.parametrize("damage", ["cut", "removed"])
def test_a_journal_that_others_change_does_not_replace_the_run(damage, path, monkeypatch):
    monkeypatch.setattr(recording, "FLUSHED_EVERY", 0.0)
    lrf3d.record(simulation(scans=5), path)
    before = path.read_bytes()
    journal = path.with_suffix(".journal")

    def meddle(done, total):
        if done == total and damage == "cut":
            os.truncate(journal, 500)
        elif done == total:
            journal.unlink()

    with pytest.raises(OutputError, match=r"run\.journal"):
        lrf3d.record(simulation(scans=400), path, progress=meddle)
    assert path.read_bytes() == before


@pytest.mark.parametrize("name", ["run.npz", "run.journal"])
def test_what_cannot_be_replaced_is_known_before_the_drive(name, tmp_path):
    (tmp_path / name).mkdir()
    with pytest.raises(InputError, match=f"{name}: a folder, expected a file of an earlier run"):
        lrf3d.record(simulation(scans=5), tmp_path / "run.npz", progress=stopping(1))


def test_what_lies_beside_a_finished_run_is_taken_away_when_it_is_resumed(path, tmp_path):
    lrf3d.record(simulation(scans=5), path)
    path.with_suffix(".journal").write_bytes(b"left")
    lrf3d.record(simulation(scans=5), path, resume=True)
    assert [file.name for file in tmp_path.iterdir()] == ["run.npz"]


def test_what_a_robot_believed_is_kept_and_resumed_to_the_last_bit(path, tmp_path):
    def made(scans=90):
        return simulation(scans=scans, mapper=SlamMapper(rng=1))

    whole = lrf3d.record(made(), tmp_path / "whole.npz")
    assert len(whole.estimate) == len(whole.estimate.odometry) == 90
    assert whole.estimate.known_scans.tolist() == list(range(0, 90, COVARIANCE_INTERVAL))
    record_up_to(60, made(), path)
    lrf3d.record(made(), path, resume=True)
    assert path.read_bytes() == (tmp_path / "whole.npz").read_bytes()
    lrf3d.save_run(whole, path)
    kept = lrf3d.load_run(path).estimate
    for name in ("poses", "known_scans", "covariances", "closures", "dropped_closures", "odometry"):
        assert getattr(kept, name).tolist() == getattr(whole.estimate, name).tolist()
    with np.load(path) as arrays:
        changed = {**arrays, "estimate_poses": np.zeros((4, 3))}
    np.savez(path, **changed)
    with pytest.raises(InputError, match=r"run\.npz: .*4"):
        lrf3d.load_run(path)
    assert lrf3d.record(simulation(scans=5), tmp_path / "bare.npz").estimate is None
