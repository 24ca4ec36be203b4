"""What errors say."""

import sys

from lrf3d.base import errors
from lrf3d.base.errors import missing_extra


def test_an_extra_is_installed_by_name_and_in_a_checkout_from_there(tmp_path, monkeypatch):
    monkeypatch.setattr(errors, "__file__", str(tmp_path / "lrf3d" / "base" / "errors.py"))
    assert str(missing_extra("no gym", "gym")).endswith("install it: pip install 'lrf3d[gym]'")
    (tmp_path / "pyproject.toml").touch()
    command = f"{sys.executable} -m pip install -e '{tmp_path}[view]'"
    assert str(missing_extra("no page", "view")) == f"no page; install it: {command}"
