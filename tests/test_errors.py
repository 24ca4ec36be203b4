"""What errors say."""

import sys

from lrf3d import errors
from lrf3d.errors import install_command


def test_in_a_checkout_the_command_installs_the_checkout(tmp_path, monkeypatch):
    monkeypatch.setattr(errors, "__file__", str(tmp_path / "lrf3d" / "errors.py"))
    (tmp_path / "pyproject.toml").touch()
    assert install_command("view") == f"{sys.executable} -m pip install -e '{tmp_path}[view]'"


def test_a_release_is_installed_by_its_name(tmp_path, monkeypatch):
    monkeypatch.setattr(errors, "__file__", str(tmp_path / "lrf3d" / "errors.py"))
    assert install_command("gym") == "pip install 'lrf3d[gym]'"
