"""Checkers of files that come from npm; scripts/test installs them into .node."""

import json
import shutil
import subprocess
from pathlib import Path

import pytest

MODULES = Path(__file__).parents[2] / ".node" / "node_modules"


def needs(package):
    """A mark that skips a test where a checker is not installed, and says so."""
    reason = ""
    if shutil.which("node") is None:
        reason = "node is not installed"
    elif not (MODULES / package).is_dir():
        reason = f"{package} is not installed: scripts/test does it where npm is"
    return pytest.mark.skipif(bool(reason), reason=reason or "none")


def told(package, program, files):
    """What a program prints, as JSON; its arguments are the checker's folder and the files."""
    done = subprocess.run(
        ["node", "-e", program, str(MODULES / package), *map(str, files)],
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    answer = json.loads(done.stdout)
    assert len(answer) == len(files)
    return answer
