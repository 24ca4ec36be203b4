"""Run files that are damaged, and runs that cannot be recorded: one line says what is wrong."""

import io
import json
import os
import zipfile

import numpy as np
import pytest
from numpy.lib import format as npy
from stops import record_up_to

import lrf3d
from lrf3d import InputError, LaserRangeFinder, World
from lrf3d.recordings.formats import npz
from lrf3d.world.cameras import FilmPlan

ROOM = World([[0, 0, 10, 0], [10, 0, 10, 8], [10, 8, 0, 8], [0, 8, 0, 0]])
LRF = LaserRangeFinder(beams=7, range_max=20.0)
POSES = [(2.0, 2.0, 0.0), (3.0, 2.0, 0.1), (4.0, 2.0, 0.2)]


def simulation(rng=0):
    return lrf3d.Simulation(ROOM, POSES, LRF, rng=rng)


@pytest.fixture
def run_file(tmp_path):
    path = tmp_path / "run.npz"
    lrf3d.record(simulation(), path)
    return path


def changed(path, **arrays):
    """The run file with other arrays in place of its own."""
    with np.load(path) as file:
        kept = dict(file)
    np.savez(path, **{**kept, **arrays})
    return path


def as_bytes(array, version):
    stream = io.BytesIO()
    npy.write_array(stream, array, version=version)
    return stream.getvalue()


@pytest.mark.parametrize(
    ("name", "array", "words"),
    [
        ("poses", np.zeros((2, 3)), "poses"),
        ("ranges", np.zeros((3, 6)), r"ranges \(3, 6\); expected \(3, 7\)"),
        ("ranges", np.full((3, 7), np.nan), "ranges hold NaN"),
        ("walls", np.zeros((3, 8), np.int64), r"walls \(3, 8\)"),
        ("walls", np.full((3, 7), 4), "walls from 4 to 4, which the world has not"),
        ("snapshot_scans", np.array([2, 1, 0]), "expected an ascending scan from 0 to 2"),
        ("map_sizes", np.array([10**9, -(10**9), 0]), "map_sizes"),
        ("segments", np.zeros((1, 4)), ""),
        ("settings", np.array("[" * 100_000), ""),
        ("settings", np.array('{"laser": {"beams": 61}}'), "holds no 'name'"),
        ("ranges", np.zeros((3, 7), np.complex128), "numbers"),
        ("version", np.array(1), "version 1 .*reads version 2; run the simulation again"),
        ("version", np.array([object()], dtype=object), ""),
    ],
)
def test_arrays_that_do_not_fit_each_other_are_named(run_file, name, array, words):
    changed(run_file, **{name: array})
    with pytest.raises(InputError, match=rf"run\.npz: .*{words}"):
        lrf3d.load_run(run_file)


@pytest.mark.parametrize(("key", "value"), [("playback", "fast"), ("playback", -1), ("view", 7)])
def test_an_invalid_setting_of_the_film_is_named(run_file, key, value):
    with np.load(run_file) as file:
        settings = json.loads(str(file["settings"]))
    settings["film"][key] = value
    changed(run_file, settings=np.array(json.dumps(settings)))
    with pytest.raises(InputError, match=rf"run\.npz: film: {key} {value!r}: expected a"):
        lrf3d.load_run(run_file)


@pytest.mark.parametrize(
    ("data", "packing", "words"),
    [
        # A header without its end, and a small file that would fill the memory.
        (as_bytes(np.zeros(3), (1, 0)).replace(b"}", b"("), zipfile.ZIP_STORED, "damaged"),
        (as_bytes(np.zeros(4_000_000), (1, 0)), zipfile.ZIP_DEFLATED, "it unpacks to 32,"),
    ],
    ids=["no end", "large"],
)
def test_a_run_with_a_further_array_that_is_damaged_or_huge_is_refused(
    data, packing, words, run_file, monkeypatch
):
    monkeypatch.setattr(npz, "MOST_PACKED", 1_000_000)
    with zipfile.ZipFile(run_file, "a", packing) as file:
        file.writestr("more.npy", data)
    with pytest.raises(InputError, match=words):
        lrf3d.load_run(run_file)


def test_a_large_array_that_claims_more_than_the_file_holds_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(npz, "MAPPED", 1)
    path = tmp_path / "run.npz"
    with zipfile.ZipFile(path, "w") as file:
        file.writestr("x.npy", as_bytes(np.zeros(1000), (1, 0)))
    whole = path.read_bytes()
    # The list of entries stays whole, as if bytes of the array had been lost on a disk.
    os.truncate(path, 500)
    with path.open("ab") as stream:
        stream.write(whole[-22 - len("x.npy") - 46 :])
    with pytest.raises(npz.DAMAGES):
        npz.read_arrays(path)


def test_a_generator_whose_state_cannot_be_saved_is_refused_before_the_drive(tmp_path):
    rng = np.random.Generator(np.random.MT19937(0))
    with pytest.raises(InputError, match=r"rng with MT19937.*default_rng"):
        lrf3d.record(simulation(rng), tmp_path / "run.npz")
    assert list(tmp_path.iterdir()) == []


def test_a_finished_run_that_is_damaged_is_recorded_again(run_file):
    whole = run_file.read_bytes()
    run_file.write_bytes(whole[: len(whole) // 2])
    lrf3d.record(simulation(), run_file, resume=True)
    assert run_file.read_bytes() == whole


def farther(scan, rng):
    return lrf3d.LaserScan(scan.pose, scan.angles, scan.ranges + 0.5, range_max=scan.range_max)


def test_a_run_with_a_noise_and_a_film_plan_of_its_own_is_resumed(tmp_path):
    path, film = tmp_path / "run.npz", FilmPlan("overview", 3.0, "intensity")

    def made():
        simulation = lrf3d.Simulation(ROOM, POSES, LRF, noise=farther, rng=0)
        simulation.film = film
        return simulation

    record_up_to(2, made(), path)
    run = lrf3d.record(made(), path, resume=True)
    assert run.film == film and len(run) == len(POSES)
    with pytest.raises(InputError, match="no poses from odom in it; a run has only true poses"):
        lrf3d.load_log(path, poses="odom")


def test_a_name_with_a_nul_character_is_refused():
    with pytest.raises(InputError, match=r"drive.x00\.log: cannot be read: embedded null"):
        lrf3d.load_log("drive\0.log")
