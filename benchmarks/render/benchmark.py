"""``bench render``: what does a picture cost, beside stock pyrender, and how clean is it?

The city is drawn at both kinds of smoothing, layer by layer, with its floor and with stock
pyrender beside it; generated cities show how the time grows with the buildings. The error of a
picture is its distance from the same picture drawn at 16 times the pixels and averaged.
"""

import os
import time
from collections.abc import Callable, Sequence
from itertools import cycle

import numpy as np

from lrf3d.geometry import Float
from lrf3d.render.film import LAYERS, Film
from lrf3d.render.stock import StockFilm
from lrf3d.simulation import Run
from lrf3d.study.bench.render_ablation import ablate_render
from lrf3d.study.bench.render_error import REFERENCE, picture_error, supersampled
from lrf3d.study.bench.render_result import PICTURE, Drawn, RenderBenchmark
from lrf3d.study.bench.render_scenes import city_run, generated_run
from lrf3d.study.timing import take_turns

SIZES = (40, 400, 4000)
"""Buildings of the generated cities."""

FRAMES = 24
"""Moments of a run that are drawn in turn."""

PLAYBACK = 4.0
"""Seconds of a run in a second of its film."""

SECONDS = 90.0
"""Time for all [s], where none is given."""


def bench_render(
    sizes: Sequence[int] = SIZES,
    *,
    seconds: float = SECONDS,
    size: tuple[int, int] = PICTURE,
    scans: int = 60,
    with_ablation: bool = False,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> RenderBenchmark:
    """Draw the city and generated cities in all ways, and time them by turns.

    Args:
        sizes: Buildings of the generated cities.
        seconds: Time for all [s]; what has begun is finished.
        size: Width and height of the pictures [pixels].
        scans: Scans of each run.
        with_ablation: Also time each piece of skipped work on and off.
        progress: Called with the steps done, and of how many.

    Raises:
        MissingLibraryError: There is no OpenGL on this machine.
    """
    begin = time.monotonic()
    result = RenderBenchmark(load=os.getloadavg()[0] if hasattr(os, "getloadavg") else None)
    total = 4 if with_ablation else 3
    # Two parts for the city, and one for the layers, for each size and for the ablation.
    share = seconds / (3 + len(sizes) + with_ablation)
    steps = iter(range(1, total + 1))
    city = city_run(scans)
    _city(result, city, size, 2.0 * share)
    progress(next(steps), total)
    _layers(result, city, size, share)
    progress(next(steps), total)
    _growth(result, sizes, size, scans, share * len(sizes))
    progress(next(steps), total)
    if with_ablation:
        result.savings = ablate_render(city, _times(city), size=size, seconds=share)
        progress(next(steps), total)
    result.took = time.monotonic() - begin
    return result


def _city(result: RenderBenchmark, run: Run, size: tuple[int, int], seconds: float) -> None:
    """All ways to draw the city, with their errors."""
    times = _times(run)
    films: dict[tuple[str, int], Film | StockFilm] = {
        ("lrf3d", 0): _film(run, size, 0),
        ("lrf3d", 4): _film(run, size, 4),
        ("lrf3d, twice the size", 0): _film(run, (2 * size[0], 2 * size[1]), 0),
        ("stock pyrender", 4): StockFilm(run, size=size, playback=PLAYBACK),
        ("stock, merged meshes", 4): StockFilm(run, size=size, playback=PLAYBACK, merged=True),
        ("stock, no shadows", 4): StockFilm(run, size=size, playback=PLAYBACK, shadows=False),
    }
    floors = {("floor: clear and read", samples): _film(run, size, samples) for samples in (0, 4)}
    calls = {str(key): _frames(film, times) for key, film in films.items()}
    calls |= {str(key): _floor(film) for key, film in floors.items()}
    timings = take_turns(calls, seconds=seconds)
    errors = _errors(run, size, float(times[len(times) // 2]))
    buildings = run.world.object_count
    for key in [*films, *floors]:
        result.entries.append(Drawn("city", buildings, *key, timings[str(key)], errors.get(key)))
    for film in (*films.values(), *floors.values()):
        film.close()


def _growth(
    result: RenderBenchmark,
    sizes: Sequence[int],
    size: tuple[int, int],
    scans: int,
    seconds: float,
) -> None:
    """Generated cities, by turns."""
    runs = {str(buildings): generated_run(buildings, scans) for buildings in sorted(sizes)}
    films = {key: _film(run, size, 0) for key, run in runs.items()}
    calls = {key: _frames(film, _times(runs[key])) for key, film in films.items()}
    for key, timing in take_turns(calls, seconds=seconds).items():
        result.entries.append(Drawn(runs[key].world.name, int(key), "lrf3d", 0, timing))
    for film in films.values():
        film.close()


def _errors(run: Run, size: tuple[int, int], time: float) -> dict[tuple[str, int], float]:
    """How far a picture of each way is off its own at 16 times the pixels; words are left out."""
    layers = [layer for layer in LAYERS if layer not in ("hud", "inset")]

    def own(samples: int) -> Callable[[tuple[int, int]], Film]:
        return lambda size: Film(
            run, size=size, view="chase", samples=samples, playback=PLAYBACK, layers=layers
        )

    def stock(size: tuple[int, int]) -> StockFilm:
        return StockFilm(run, size=size, playback=PLAYBACK)

    ours = supersampled(own(0), size, time, REFERENCE)
    theirs = picture_error(
        supersampled(stock, size, time, 1), supersampled(stock, size, time, REFERENCE)
    )
    return {
        ("lrf3d", 0): picture_error(supersampled(own(0), size, time, 1), ours),
        ("lrf3d", 4): picture_error(supersampled(own(4), size, time, 1), ours),
        ("lrf3d, twice the size", 0): picture_error(supersampled(own(0), size, time, 2), ours),
        ("stock pyrender", 4): theirs,
        ("stock, merged meshes", 4): theirs,
    }


def _layers(result: RenderBenchmark, run: Run, size: tuple[int, int], seconds: float) -> None:
    """What each layer costs: the full look without it, taken from the full look.

    By lower quartiles: the differences are smaller than what a busy machine adds to medians.
    """
    times = _times(run)
    films = {
        layer: Film(
            run,
            size=size,
            view="chase",
            samples=0,
            playback=PLAYBACK,
            layers=[other for other in LAYERS if other != layer],
        )
        for layer in (*LAYERS, "")
    }
    calls = {layer: _frames(film, times) for layer, film in films.items()}
    timings = take_turns(calls, seconds=seconds)
    full = timings[""].low
    result.layers = {layer: full - timings[layer].low for layer in LAYERS}
    result.layers["solids, and all else"] = full - sum(result.layers.values())
    for film in films.values():
        film.close()


def _film(run: Run, size: tuple[int, int], samples: int) -> Film:
    return Film(run, size=size, view="chase", samples=samples, playback=PLAYBACK)


def _times(run: Run) -> Float:
    """Moments of a run [s] that are drawn in turn; no two are alike."""
    first, last = run.trajectory.times[[0, -1]].tolist()
    return np.linspace(first, last, FRAMES)


def _frames(film: Film | StockFilm, times: Float) -> Callable[[int], object]:
    """What draws the frame of a number."""
    order = cycle(times.tolist())

    def draw(number: int) -> object:
        # As in a film, one moment after the other.
        if isinstance(film, Film):
            film.forget()
        return film.draw(next(order))

    return draw


def _floor(film: Film) -> Callable[[int], object]:
    """What clears and reads a picture, and draws nothing."""

    def draw(number: int) -> object:
        film.renderer.begin(film.scenery.scene)
        film.renderer.flatten()
        return film.renderer.finish()

    return draw
