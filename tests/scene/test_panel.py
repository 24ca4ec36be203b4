"""What films say."""

from dataclasses import replace

import numpy as np
import pytest
from test_render import SIZE, city_run, room_run

from lrf3d.errors import InputError
from lrf3d.scene.camera import Look
from lrf3d.scene.panel import Facts, panel
from lrf3d.scene.timeline import Timeline
from lrf3d.text import counted


def said(run, kind, shot="chase", *, time=1.0, glass=0.0):
    """The lines of a panel."""
    view = Look(np.zeros(3), np.ones(3), 1.0, shot=shot, glass=glass)
    return panel(Facts(run, 1.0, kind), Timeline(run).moment(time), view).text


def test_a_short_panel_says_what_is_shown_when_and_what_is_found_and_a_full_one_all():
    short, full = (said(city_run(), kind) for kind in ("short", "full"))
    assert len(short) == 2 and "beams" in short[0] and " walls" in short[1]
    assert len(full) > 3 and full[0] == short[0] and any("beams hit" in line for line in full)


@pytest.mark.parametrize("make", [city_run, room_run])
def test_the_card_counts_the_walls_found_and_the_objects_of_the_map(make):
    run = make()
    found, rest = said(run, "short", "end", glass=1.0)
    assert rest.endswith(counted(run.map.object_count, "object"))
    # Of all walls of the world, also of those that were never in sight.
    seen, count = len(run.map), len(run.world.segments)
    assert found == f"{seen} of {count} walls found, {100 * seen / count:.0f} %"


def test_before_the_start_nothing_is_known():
    assert said(city_run(), "short", "wave", time=-0.5)[0] == "The robot knows nothing yet"


@pytest.mark.parametrize("shot", ["chase", "wave", "rise", "high", "end"])
def test_no_number_is_said_twice_and_walls_are_always_counted(shot):
    head, rest = said(city_run(), "short", shot)
    counts = [word for word in f"{head} {rest}".split() if word.isdigit()]
    assert len(set(counts)) == len(counts) and "wall" in head + rest


def test_a_panel_of_another_kind_is_refused():
    with pytest.raises(InputError, match="expected one of full, short"):
        replace(city_run()).frame(1.0, size=SIZE, renderer="embree", panel="some")
