"""What films say."""

from dataclasses import replace

import numpy as np
import pytest
from test_estimate import estimated
from test_render import SIZE, city_run, room_run

from lrf3d import InputError, LineMap
from lrf3d.scoring.map_score import found_words, score_run
from lrf3d.studio.render import beside
from lrf3d.studio.render.beside import MapBeside
from lrf3d.studio.render.film import Film
from lrf3d.studio.render.text import row_of
from lrf3d.studio.scene.camera import Look
from lrf3d.studio.scene.found import lost_walls
from lrf3d.studio.scene.moments import Scene
from lrf3d.studio.scene.panel import panel
from lrf3d.studio.scene.stage.stage import stage_of
from lrf3d.studio.scene.timeline import Timeline


def said(run, shot="chase", *, time=1.0, playback=1.0, full=False):
    """The lines of a panel."""
    view = Look(np.zeros(3), np.ones(3), 1.0, shot=shot)
    return panel(run, Timeline(run).moment(time), view, playback, full=full).text


def test_a_short_panel_says_what_is_shown_when_and_what_is_found_and_a_full_one_all():
    short, full = (said(city_run(), full=full) for full in (False, True))
    assert len(short) == 2 and " walls found" in short[0] and "1 s" in short[1]
    assert len(full) > 3 and full[0] == short[0] and any("beams hit" in line for line in full)


def test_a_number_is_said_once_and_a_film_that_runs_faster_says_so():
    run = city_run()
    head, passed = said(run, "whole", playback=0.3)
    score = score_run(run)
    found = f"{score.found_segments} of {score.visible_segments} walls found"
    assert head == found and passed == "1 s"
    assert "1 s at 3 × speed" in said(run, playback=3.0)[1]


def test_while_a_map_grows_the_walls_found_are_counted_and_without_the_truth_its_segments():
    run = city_run()
    maps = (replace(run.map, segments=run.map.segments + 9.0), run.map)
    grows = replace(run, maps=maps, snapshot_scans=(0, len(run) - 1))
    assert said(grows)[0] == "0 of 14 walls found, 16 false"
    recorded = said(estimated(run, (0.0, 0.0, 0.0)))
    assert recorded[0] == f"{len(run.map)} segments mapped"


@pytest.mark.parametrize("make", [city_run, room_run])
def test_the_card_counts_the_walls_found(make):
    run = make()
    found, _ = said(run, "end")
    # The sentence of the console and the summary.
    assert found == found_words(score_run(run).as_dict())


def test_the_card_of_a_run_without_maps_says_what_was_seen():
    run = replace(room_run(), snapshot_scans=(), maps=())
    assert said(run, "end")[0] == f"{run.ranges.shape[1]} laser beams, {len(run)} scans"


@pytest.mark.parametrize("shot", ["whole", "end"])
def test_the_card_of_several_robots_counts_the_walls_of_all_also_where_no_map_fits(shot):
    run = city_run()
    maps = {name: (run, stage_of(run)) for name in ("robot 1", "robot 2")}
    film = Film(run, maps=maps, size=SIZE, renderer="embree", layers={"hud"})
    view = Look(np.zeros(3), np.ones(3), 1.0, shot=shot)
    head, *each = film._label(film.timeline.moment(film.timeline.end), view).text
    assert not film.maps and head.startswith("2 maps together: ")
    assert [words.partition(":")[0] for words in each] == ["━ Robot 1 alone", "━ Robot 2 alone"]


def test_walls_that_many_scans_hit_are_missed_without_a_reason():
    run = room_run()
    empty = replace(run, maps=(LineMap.empty(),), snapshot_scans=(len(run) - 1,))
    assert lost_walls(empty).words.endswith(" missed")


def test_a_panel_of_another_kind_is_refused():
    with pytest.raises(InputError, match="expected one of full, short"):
        replace(city_run()).frame(1.0, size=SIZE, renderer="embree", panel="some")


def test_the_caption_and_the_map_beside_count_the_same_walls(monkeypatch):
    run = city_run()
    empty, whole = LineMap.empty(), run.map
    grows = replace(run, maps=(*[empty] * 9, *[whole] * 12), snapshot_scans=tuple(range(21)))
    scene = Scene(Timeline(grows), None, None)
    rows = []
    monkeypatch.setattr(
        beside, "row_of", lambda words, *rest: rows.append(words) or row_of(words, *rest)
    )
    plan = MapBeside(scene, (90, 60), 9.0, "one")
    for scan, time in enumerate(grows.trajectory.times):
        plan.rows(time, lambda _, size: np.zeros((*size[::-1], 3), np.uint8))
        (number, *_), beside_it = said(grows, time=time)[0].split(), rows[-1][0][0]
        assert beside_it.split()[0] == number and (number == "0") == (scan < 9)
