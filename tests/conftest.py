"""What all tests share: what a test needs, and signals as in a program started by hand."""

import functools
import os
import signal
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

from lrf3d.base import interrupts, isolation

# No test depends on the speed of the machine, and examples share what their test was set up with.
settings.register_profile(
    "search",
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture],
)
# The same code is tried with the same examples; `--hypothesis-profile search` draws others.
settings.register_profile("lrf3d", settings.get_profile("search"), derandomize=True)
settings.load_profile("lrf3d")

# A shell without job control ignores Ctrl-C for what it starts in the background, and so do all
# programs that these start in turn.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
# So does nohup with the end of the terminal. What handles a signal here leaves it as usual to the
# programs that tests start.
if signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:
    signal.signal(signal.SIGHUP, lambda number, where: None)

# Files are read in this process, which spares the start of another and sees what tests replace;
# what tests the other process sets this to 1.
os.environ[isolation.FACTOR] = "0"

# The handlers of signals before any test.
USUAL = {n: signal.getsignal(n) for n in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}


@pytest.fixture(autouse=True)
def handlers():
    """The program's own handlers of signals end with the test, whatever has called its main()."""
    yield
    for number, handler in USUAL.items():
        signal.signal(number, handler)
    interrupts._asked = 0


@pytest.fixture
def written(tmp_path):
    """Writes a text, or bytes, to a file of the folder of the test; returns its path."""

    def write(name, content):
        path = tmp_path / name
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    return write


@pytest.fixture(scope="module")
def chromium():
    """Chromium, for as many pages as the tests of a file want."""
    from browser import CHROMIUM, OPTIONS
    from playwright.sync_api import sync_playwright

    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=CHROMIUM, args=OPTIONS)
        yield browser
        browser.close()


@functools.cache
def has_gl():
    """Whether anything can be drawn with OpenGL here."""
    from lrf3d.studio.render.gl import gl_available

    return gl_available()


# What scripts/test --all has run with indices checked is not run again.
def pytest_addoption(parser):
    parser.addoption(
        "--slow-of",
        metavar="FOLDER",
        action="append",
        type=Path,
        default=[],
        help="run the slow tests of a folder alone",
    )


def pytest_collection_modifyitems(config, items):
    folders = [folder.resolve() for folder in config.getoption("--slow-of")]
    items[:] = [
        item
        for item in items
        if item.get_closest_marker("slow")
        or not any(item.path.is_relative_to(folder) for folder in folders)
    ]


def pytest_runtest_setup(item):
    """Skip, before its fixtures are made, a test that needs what this machine lacks."""
    if item.get_closest_marker("gl") and not has_gl():
        pytest.skip("no OpenGL library on this machine")
