"""Kernels are compiled side by side before they are needed."""

import os
import subprocess
import sys

from lrf3d.apps.cli import kernels

FIND = """
from lrf3d.apps.cli import kernels
calls = kernels._calls("slam", "planar")
print(*(name for _, name, _ in calls))
kernels._calls = lambda: [call for call in calls if call[1] == "measure_beams"]
kernels.main()
"""


def test_what_a_drive_calls_is_found_and_compiled_by_other_processes(tmp_path):
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1", "NUMBA_CACHE_DIR": str(tmp_path)}
    done = subprocess.run([sys.executable, "-c", FIND], env=environment, capture_output=True,
                          text=True, check=True)  # fmt: skip
    found, counted = done.stdout.splitlines()
    assert {"_build", "cast_scans", "add_beams", "refit_walls", "link_walls", "_matched"} <= {
        *found.split()
    }
    assert counted == "1 1"


def test_nothing_is_started_where_kernels_are_kept_or_cannot_be(tmp_path, monkeypatch):
    monkeypatch.setattr(kernels, "core_count", lambda: 2)
    monkeypatch.setattr(
        kernels, "__file__", str(tmp_path / "lrf3d" / "apps" / "cli" / "kernels.py")
    )
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setattr(kernels, "Popen", lambda *_, **__: "started")
    assert kernels.start_compiling() == "started"
    (tmp_path / "cache").mkdir()
    (tmp_path / "cache" / kernels.FILES.replace("*", "py")).touch()
    assert kernels.start_compiling() is None
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "nowhere" / "cache"))
    assert kernels.start_compiling() is None


def test_a_command_waits_until_all_is_compiled():
    code = "import os; os.write(1, b'1 2\\n'); os.write(1, b'2 2\\n')"
    steps = []
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE) as process:
        kernels.wait_for(process, lambda done, total: steps.append((done, total)))
    assert steps[-1] == (2, 2)
