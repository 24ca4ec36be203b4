"""What errors say."""

import sys

import pytest

from lrf3d import errors
from lrf3d.errors import install_command


@pytest.fixture
def environment(tmp_path, monkeypatch):
    """An environment in a folder of its own, with pip."""
    program = tmp_path / ".venv" / "bin" / "python"
    program.parent.mkdir(parents=True)
    program.with_name("pip").touch()
    monkeypatch.setattr(sys, "executable", str(program))
    return tmp_path


def test_in_a_checkout_the_command_installs_the_checkout(environment, monkeypatch):
    monkeypatch.setattr(errors, "__file__", str(environment / "lrf3d" / "errors.py"))
    (environment / "pyproject.toml").touch()
    monkeypatch.chdir(environment)
    assert install_command("view") == ".venv/bin/pip install -e '.[view]'"
    (environment / "elsewhere").mkdir()
    monkeypatch.chdir(environment / "elsewhere")
    assert install_command("view").endswith(f"/.venv/bin/pip install -e '{environment}[view]'")


def test_without_pip_beside_python_its_module_is_named(environment):
    (environment / ".venv" / "bin" / "pip").unlink()
    assert "/.venv/bin/python -m pip install -e" in install_command("ros")


def test_a_release_is_installed_by_its_name(environment, monkeypatch):
    installed = environment / "site-packages" / "lrf3d" / "errors.py"
    monkeypatch.setattr(errors, "__file__", str(installed))
    assert install_command("gym") == "pip install 'lrf3d[gym]'"
