"""What errors say."""

import sys

from lrf3d import errors
from lrf3d.errors import missing_extra


def test_in_a_checkout_the_command_installs_the_checkout(tmp_path, monkeypatch):
    monkeypatch.setattr(errors, "__file__", str(tmp_path / "lrf3d" / "errors.py"))
    (tmp_path / "pyproject.toml").touch()
    command = f"{sys.executable} -m pip install -e '{tmp_path}[view]'"
    assert str(missing_extra("no page", "view")) == f"no page; install it: {command}"


def test_a_release_is_installed_by_its_name(tmp_path, monkeypatch):
    monkeypatch.setattr(errors, "__file__", str(tmp_path / "lrf3d" / "errors.py"))
    assert str(missing_extra("no gym", "gym")).endswith("install it: pip install 'lrf3d[gym]'")
