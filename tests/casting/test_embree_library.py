"""Finding Embree's library: one of another version, or that answers wrongly, is not used."""

import ctypes
import math
import multiprocessing
import sys

import numpy as np
import pytest

from lrf3d.casting import embree_library as module
from lrf3d.casting import triangle_rays
from lrf3d.casting.triangle_rays import TriangleRays
from lrf3d.errors import MissingLibraryError

pytest.importorskip("embreex", reason="has no wheel for this system")

CORNERS = np.array([[1, -1, -1], [1, 1, -1], [1, 0, 9]], np.float32)


@pytest.fixture
def functions():
    """Embree's functions, which each test may replace."""
    return ctypes.CDLL(str(next(iter(module._candidates()))))


def test_embree_that_gives_no_device_is_not_used(functions):
    functions.rtcNewDevice = lambda _: None
    with pytest.raises(OSError, match="no device"):
        module.EmbreeLibrary(functions)


def test_embree_of_another_version_is_not_used(functions):
    functions.rtcGetDeviceProperty = lambda *_: 3
    with pytest.raises(OSError, match="Embree 3, expected 4"):
        module.EmbreeLibrary(functions)


def test_a_scene_that_embree_cannot_build_is_an_error(functions):
    library = module.EmbreeLibrary(functions)
    functions.rtcGetDeviceError = lambda _: 4
    with pytest.raises(OSError, match="reports error 4"):
        library.build(CORNERS, np.array([[0, 1, 2]]))


def found(monkeypatch, *candidates):
    monkeypatch.setattr(module, "_candidates", lambda: iter(candidates))
    return module.embree_library.__wrapped__()


def test_the_first_file_that_has_embree_is_taken(monkeypatch, tmp_path):
    real = list(module._candidates())
    assert all(path.exists() for path in real)
    text = tmp_path / "embree4.txt"
    text.write_text("no library")
    other = math.__spec__.origin if math.__spec__.origin != "built-in" else ctypes._ctypes.__file__
    assert found(monkeypatch, text, other) is None
    assert found(monkeypatch, text, other, *real) is not None


def test_embree_that_answers_wrongly_is_not_used(monkeypatch):
    real = list(module._candidates())
    monkeypatch.setattr(module, "_answers", lambda _: False)
    assert found(monkeypatch, *real) is None


def test_without_embreex_nothing_is_looked_for(monkeypatch):
    monkeypatch.setattr(module, "embreex_installed", lambda: False)
    assert found(monkeypatch) is None
    monkeypatch.setitem(sys.modules, "embreex.rtcore_scene", None)
    with pytest.raises(MissingLibraryError, match="crosscheck needs Embree: pip install embreex"):
        module.require_embreex("crosscheck")


def test_only_the_first_process_says_that_embreex_is_missing(monkeypatch):
    monkeypatch.setitem(sys.modules, "embreex.rtcore_scene", None)
    with pytest.warns(module.Lrf3dWarning, match="embreex is not installed"):
        assert not module.embreex_installed.__wrapped__()
    # A warning would be an error here.
    monkeypatch.setattr(multiprocessing, "parent_process", lambda: object())
    assert not module.embreex_installed.__wrapped__()


def test_rays_meet_the_same_triangles_with_and_without_embree(monkeypatch):
    rng = np.random.default_rng(0)
    triangles = np.stack([CORNERS, CORNERS + np.float32([2, 3, 0])])
    directions = rng.normal(size=(200, 3)).astype(np.float32)
    origins = np.zeros((200, 3), np.float32)
    first = TriangleRays(triangles).first(origins, directions)
    assert set(first.tolist()) == {-1, 0, 1}
    monkeypatch.setattr(triangle_rays, "embreex_installed", lambda: False)
    assert np.array_equal(first, TriangleRays(triangles).first(origins, directions))
    none = TriangleRays(np.empty((0, 3, 3), np.float32))
    assert none.first(origins, directions).tolist() == [-1] * 200
