"""Debian's Chromium, without a window, and the pages of ``lrf3d view`` in it."""

import importlib.util
import io
import os
import re
import shutil
import signal
import subprocess
import sys
from contextlib import contextmanager

import numpy as np
import pytest
from PIL import Image
from waiting import PATIENCE

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser"))), None)

# Chromium draws in software, and as root it wants to be told that this is meant.
OPTIONS = [
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    *(["--no-sandbox"] if os.geteuid() == 0 else []),
]


def missing():
    """Why there is no browser here; empty where there is one."""
    if CHROMIUM is None:
        return "Chromium is not installed: apt-get install chromium"
    for name in ("playwright", "websockets"):
        if importlib.util.find_spec(name) is None:
            return f"{name} is not installed: pip install 'lrf3d[dev]'"
    return ""


needs_browser = pytest.mark.skipif(bool(missing()), reason=missing() or "none")


@contextmanager
def served(what, *options, command="view"):
    """Serve a view of a run or a world; gives its address, and sees that Ctrl-C ends it."""
    command = [sys.executable, "-m", "lrf3d", command, str(what), "--no-browser", *options]
    program = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        line = program.stdout.readline()
        address = re.search(r"http://\S+(?=;)", line)
        assert address, line + program.stderr.read()
        yield address.group()
        assert program.poll() is None
        program.send_signal(signal.SIGINT)
        said = program.communicate(timeout=PATIENCE)
        assert (program.returncode, said) == (130, ("", "lrf3d: stopped\n")), said
    finally:
        program.kill()
        program.wait()
        program.stdout.close()
        program.stderr.close()


@contextmanager
def opened(browser, address, size=(660, 372), **options):
    """A page in Chromium, ready to be used; whatever it complains of fails the test."""
    complaints, asked = [], []
    viewport = dict(zip(("width", "height"), size, strict=True))
    with browser.new_page(viewport=viewport, **options) as page:
        page.set_default_timeout(1000.0 * PATIENCE)
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.on(
            "console",
            lambda said: said.type in ("error", "warning") and complaints.append(said.text),
        )
        page.on("request", lambda request: asked.append(request.url))
        page.goto(address)
        page.locator(".lrf3d-failure").wait_for(state="detached")
        yield page
        assert complaints == []
        own = (f"{address}/", f"blob:{address}/", f"{address.replace('http', 'ws')}/")
        others = [url for url in asked if not url.startswith((*own, "data:"))]
        assert [url for url in others if url != address] == []


def picture(page):
    """The page as it is seen: (height, width, 3) of 0…255."""
    return np.asarray(Image.open(io.BytesIO(page.screenshot())).convert("RGB")).astype(int)


def number(page, name):
    """A number that the page shows, by the ending of its class; NaN while it shows none yet."""
    return float(page.inner_text(f".lrf3d-{name}") or "nan")
