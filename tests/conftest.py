"""What all tests share."""

import functools

import pytest


@functools.cache
def has_gl():
    """Whether anything can be drawn with OpenGL here."""
    from lrf3d.render.gl import gl_available

    return gl_available()


def pytest_runtest_setup(item):
    """Skip, before its fixtures are made, a test that needs what this machine lacks."""
    if item.get_closest_marker("gl") and not has_gl():
        pytest.skip("no OpenGL library on this machine")
