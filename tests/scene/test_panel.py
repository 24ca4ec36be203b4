"""What films say."""

from dataclasses import replace

import pytest
from test_render import SIZE, city_run, room_run

from lrf3d.errors import InputError
from lrf3d.scene.panel import Facts, card, panel
from lrf3d.scene.structures import Structures
from lrf3d.scene.timeline import Timeline


def said(run, kind, shot="chase"):
    facts = Facts(run, Structures.from_run(run), 1.0, kind)
    return facts, panel(facts, Timeline(run).moment(1.0), shot).text


def test_a_short_panel_says_what_is_shown_when_and_what_is_found_and_a_full_one_all():
    _, short = said(city_run(), "short")
    _, full = said(city_run(), "full")
    assert len(short) == 2 and "beams" in short[0] and "walls found" in short[1]
    assert len(full) > 3 and full[0] == short[0] and any("beams hit" in line for line in full)


@pytest.mark.parametrize(("make", "word"), [(city_run, "building"), (room_run, "object")])
def test_the_card_counts_buildings_only_where_there_are_some(make, word):
    facts, _ = said(make(), "short")
    assert word in card(facts).text[0]


def test_a_panel_of_another_kind_is_refused():
    with pytest.raises(InputError, match="expected one of full, short"):
        replace(city_run()).frame(1.0, size=SIZE, renderer="embree", panel="some")
