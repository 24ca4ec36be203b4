"""Ablation of drawing: each piece of work that films skip, timed with it skipped and done."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks.render.scenes import frames, generated_run, make_film
from benchmarks.result import Result
from benchmarks.timing import take_turns
from lrf3d.casting import PlanarCaster
from lrf3d.geometry import Float, Int
from lrf3d.render.film import Film
from lrf3d.render.parts import Parts, Skyline
from lrf3d.run import Run

BUILDINGS = 1000
"""Buildings of the city in which most are out of sight or hidden."""


def ablate_render(
    result: Result,
    run: Run,
    times: Float,
    *,
    size: tuple[int, int],
    seconds: float,
    buildings: int = BUILDINGS,
) -> None:
    """Time frames of the city, and of a large one, with each piece of skipped work done again."""
    large = generated_run(buildings)
    large_times = np.linspace(large.trajectory.times[0], large.trajectory.times[-1], len(times))
    caster = PlanarCaster(run.world)
    usual, smooth, huge = make_film(run, size), make_film(run, size, 4), make_film(large, size)
    films = {
        "far": _with_parts(make_film(run, size), _FarFirst),
        "all": _with_parts(make_film(large, size), _Everything),
        "unhidden": _with_parts(make_film(large, size), _NoSkyline),
        "late": _flattened_late(make_film(run, size, 4)),
    }
    calls: dict[str, Callable[[int], object]] = {
        "usual": frames(usual, times),
        "smooth": frames(smooth, times),
        "huge": frames(huge, large_times),
        "same": lambda number: usual.draw(float(times[0])),
        "flip": lambda number: np.ascontiguousarray(usual.draw(float(times[0]))[::-1, :, :3]),
        "scan": lambda number: run.scan(number % len(run)),
        "cast": lambda number: caster.cast(run.lrf, run.trajectory.poses[number % len(run)]),
        "far": frames(films["far"], times),
        "all": frames(films["all"], large_times),
        "unhidden": frames(films["unhidden"], large_times),
        "late": frames(films["late"], times),
    }
    took = {name: timing.median for name, timing in take_turns(calls, seconds=seconds).items()}
    # The picture that does not change is drawn by the same film, whose frames are in between.
    for film in (usual, smooth, huge, *films.values()):
        film.close()
    frame = took["usual"]
    for name, skipped, done in (
        (f"parts out of sight, {buildings:,} buildings", took["huge"], took["all"]),
        (f"parts hidden by others, {buildings:,} buildings", took["huge"], took["unhidden"]),
        ("pixels behind others: near parts first", frame, took["far"]),
        ("4 samples for layers that are soft", took["smooth"], took["late"]),
        ("a frame in which nothing changed", took["same"], frame),
        ("turning the picture over, without alpha", frame, frame + took["flip"]),
        ("casting a scan again for the film", took["scan"], took["cast"]),
    ):
        result.save(name, skipped, done)


class _Everything:
    """All parts, in no order."""

    def __init__(self, parts: Parts) -> None:
        self.boxes = parts.boxes
        self._all = np.arange(len(parts.boxes.low))

    def seen(self, matrix: Float, eye: Float) -> Int:
        return self._all


class _FarFirst:
    """The parts in sight, far ones first."""

    def __init__(self, parts: Parts) -> None:
        self.boxes = parts.boxes
        self._parts = parts

    def seen(self, matrix: Float, eye: Float) -> Int:
        return self._parts.seen(matrix, eye)[::-1]


class _NoSkyline(Parts):
    """The parts in the picture, also where others hide them."""

    def __init__(self, parts: Parts) -> None:
        super().__init__(
            parts.boxes, Skyline(np.zeros((0, 2)), np.zeros(0, dtype=np.int64), np.zeros(0))
        )


def _with_parts(film: Film, kind: Callable[[Parts], Any]) -> Film:
    walls = film.scenery.walls
    film.scenery.walls = replace(walls, parts=kind(walls.parts))
    return film


def _flattened_late(film: Film) -> Film:
    """A film whose soft layers are drawn with several samples a pixel too."""
    renderer: Any = film.renderer
    flatten, finish = renderer.flatten, renderer.finish
    renderer.flatten = lambda: None

    def flatten_and_finish() -> Any:
        renderer.overlay(None)
        flatten()
        return finish()

    renderer.finish = flatten_and_finish
    return film
