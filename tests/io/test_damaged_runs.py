"""Run files that are damaged, and runs that cannot be recorded: one line says what is wrong."""

import io
import os
import shutil
import zipfile

import numpy as np
import pytest
from numpy.lib import format as npy

import lrf3d
from lrf3d import InputError, LaserRangeFinder, OutputError, World
from lrf3d.io import npz
from lrf3d.io.npz import Column, write_npz

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
    ("name", "shape"), [("poses", (2, 3)), ("ranges", (3, 6)), ("truth", (2, 7)), ("walls", (3, 8))]
)
def test_arrays_that_do_not_fit_each_other_are_named(run_file, name, shape):
    kind = np.int64 if name == "walls" else np.float64
    changed(run_file, **{name: np.zeros(shape, kind)})
    with pytest.raises(InputError, match=rf"run\.npz: .*{name} of shape \({shape[0]}, {shape[1]}"):
        lrf3d.load_run(run_file)


def test_a_run_of_another_version_is_to_be_made_again(run_file):
    changed(run_file, version=np.array(999))
    with pytest.raises(InputError, match=r"version 999 .*run the simulation again"):
        lrf3d.load_run(run_file)


def test_an_array_in_a_format_of_the_future_is_refused(run_file):
    with zipfile.ZipFile(run_file, "a") as file:
        file.writestr("more.npy", as_bytes(np.zeros(3), (3, 0)))
    with pytest.raises(InputError, match=r"more\.npy is of version \(3, 0\)"):
        lrf3d.load_run(run_file)


def test_a_small_file_that_would_fill_the_memory_is_refused(run_file, monkeypatch):
    monkeypatch.setattr(npz, "SMALL_RUN", 1000)
    with zipfile.ZipFile(run_file, "a", zipfile.ZIP_DEFLATED) as file:
        file.writestr("more.npy", as_bytes(np.zeros(4_000_000), (1, 0)))
    with pytest.raises(InputError, match="it unpacks to 32,"):
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


def test_columns_that_are_not_what_they_claim_leave_no_file(tmp_path):
    path = tmp_path / "run.npz"
    for block, message in ((np.zeros(3, np.int32), "int32"), (np.zeros(2), "2 rows of")):
        with pytest.raises(OutputError, match=message):
            write_npz(path, [Column("x", (3,), np.float64, [block])])
        assert not path.exists()


def test_a_run_is_recorded_to_a_run_file(tmp_path):
    with pytest.raises(InputError, match=r"ends in \.npz"):
        lrf3d.record(simulation(), tmp_path / "run.txt")
    assert list(tmp_path.iterdir()) == []


def test_a_disk_without_room_is_known_before_the_drive(tmp_path, monkeypatch):
    monkeypatch.setattr(shutil, "disk_usage", lambda _: shutil._ntuple_diskusage(10, 9, 1))
    with pytest.raises(OutputError, match=r"take fewer scans or beams"):
        lrf3d.record(simulation(), tmp_path / "run.npz")
    assert list(tmp_path.iterdir()) == []


def test_a_generator_whose_state_cannot_be_saved_is_refused_before_the_drive(tmp_path):
    rng = np.random.Generator(np.random.MT19937(0))
    with pytest.raises(InputError, match=r"rng with MT19937.*default_rng"):
        lrf3d.record(simulation(rng), tmp_path / "run.npz")
    assert list(tmp_path.iterdir()) == []


def test_a_name_with_a_nul_character_is_refused():
    with pytest.raises(InputError, match="NUL"):
        lrf3d.load_log("drive\0.log")
