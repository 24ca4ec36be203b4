"""The program lrf3d within the process of the tests, which spares the start of another."""

import contextlib
import io
import json
import sys
from subprocess import CompletedProcess
from unittest import mock

from lrf3d.apps.cli import main


def lrf3d(*arguments, cwd=".", program=None):
    """Run a command of lrf3d, or of another program, in a folder whose modules can be named.

    Its handlers of signals stay until the end of the test.
    """
    out, err = io.StringIO(), io.StringIO()
    try:
        with (
            contextlib.chdir(cwd),
            mock.patch.object(sys, "argv", ["lrf3d", *map(str, arguments)]),
            mock.patch.object(sys, "path", ["", *sys.path]),
            contextlib.redirect_stdout(out),
            contextlib.redirect_stderr(err),
        ):
            main(program)
    except SystemExit as end:
        return CompletedProcess(arguments, end.code or 0, out.getvalue(), err.getvalue())


def ran(*arguments, cwd="."):
    """A command that has succeeded, and what it printed."""
    done = lrf3d(*arguments, cwd=cwd)
    assert done.returncode == 0, done.stderr
    return done


def told(*arguments, cwd=".", warns=False):
    """The value that a command prints, which says no word besides unless it warns."""
    done = ran(*arguments, "--json", cwd=cwd)
    assert warns or not done.stderr, done.stderr
    return json.loads(done.stdout)


def refused(*arguments, cwd="."):
    """The one line on stderr with which a command ends that meets a known error."""
    done = lrf3d(*arguments, cwd=cwd)
    assert (done.returncode, done.stdout) == (1, ""), done.stderr
    assert done.stderr.count("\n") == 1 and done.stderr.startswith("lrf3d: ")
    return done.stderr
