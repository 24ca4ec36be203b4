"""``scripts/bench render``: what does a picture cost, beside stock pyrender, and how clean is it?

The city is drawn at both kinds of smoothing, layer by layer, with stock pyrender beside it;
generated cities show how the time grows with the buildings. The error of a picture is its distance
from the same picture drawn at 16 times the pixels and averaged.
"""

import time
from collections.abc import Sequence
from functools import partial

import numpy as np
from matplotlib.figure import Figure

from benchmarks.chart import bars, draw, scatter
from benchmarks.render.scenes import (
    PLAYBACK,
    city_run,
    frames,
    generated_run,
    make_film,
    moments,
)
from benchmarks.render.stock import StockFilm
from benchmarks.result import Result, Row, Table
from benchmarks.timing import take_turns
from lrf3d.geometry import Float
from lrf3d.progress import Progress, silent
from lrf3d.render.film import Film
from lrf3d.run import Run
from lrf3d.scene.moments import LAYERS

PICTURE = (1280, 720)
"""Width and height of the pictures [pixels]."""

SIZES = (40, 400, 4000)
"""Buildings of the generated cities."""

SECONDS = 90.0
"""Time for all [s], if none is given."""

REFERENCE = 4
"""Pixels a side that a pixel of the reference is the mean of: 16 samples."""


ENTRIES = Table(
    "entries",
    {
        "title": "drawn by",
        "world": "world",
        "buildings": "buildings",
        "samples": "samples",
        "frame": "frame",
        "frame.quartiles": "quartiles",
        "error_rms": ("error", "{:.2f}".format),
    },
    "full look from the chase camera, one process; frame: the median. error: root mean square of"
    " a picture's\ndifferences, of 255, from the same way to draw at 16 times the pixels, words"
    " left out.",
    names=("title", "world", "samples"),
    time="frame",
    error="error_rms",
)
"""Each way to draw each world; the error is None where it was not measured."""

LAYER_TIMES = Table(
    "layers",
    {"layer": "layer of the city", "cost": ("time", lambda cost: f"{1e3 * cost:.2f} ms")},
)
"""What each layer of the full look costs in the city, without smoothing [s]."""


def bench_render(
    sizes: Sequence[int] = SIZES,
    *,
    seconds: float = SECONDS,
    size: tuple[int, int] = PICTURE,
    scans: int = 60,
    progress: Progress = silent,
) -> Result:
    """Draw the city and generated cities by all methods, and time them in turn.

    Args:
        sizes: Buildings of the generated cities.
        seconds: Time for all [s]; what has begun is finished.
        size: Width and height of the pictures [pixels].
        scans: Scans of each run.
        progress: Called with the steps done, and of how many.

    Raises:
        MissingLibraryError: There is no OpenGL on this machine.
    """
    begin = time.monotonic()
    result = Result(
        "render",
        f"How long does a frame of {size[0]} × {size[1]} take in software OpenGL, and how far is it"
        " off the same frame drawn with 16 times the pixels?",
        {"size": size},
        chart,
    )
    total = 3
    # Two parts for the city, and one for the layers and for each size.
    share = seconds / (3 + len(sizes))
    city = city_run(scans)
    _city(result, city, 2.0 * share)
    progress(1, total)
    _layers(result, city, share)
    progress(2, total)
    _growth(result, sizes, scans, share * len(sizes))
    progress(3, total)
    promise(result)
    result.took_s = time.monotonic() - begin
    return result


def promise(result: Result) -> None:
    """Add what is promised of the city on four cores, and of growth."""
    city = {
        (row["title"], row["samples"]): row["frame"].median
        for row in result[ENTRIES]
        if row["world"] == "city"
    }
    ours, full, stock = city["lrf3d", 0], city["lrf3d", 4], city["stock pyrender", 4]
    result.promise("frame without smoothing, city [ms]", 1e3 * ours, 12.0)
    result.promise("frame with 4 samples, city [ms]", 1e3 * full, 25.0)
    for name, own in (
        ("stock pyrender / lrf3d, city, both 4 samples", full),
        ("stock pyrender / lrf3d without smoothing, city", ours),
    ):
        result.promise(name, stock / own, 8.0, at_least=True)
    grown = _grown(result)
    if len(grown) > 1:
        few, many = grown[0], grown[-1]
        name = f"frame of {many['buildings']:,} buildings / of {few['buildings']:,}"
        result.promise(name, many["frame"].median / few["frame"].median, 1.5)


def _grown(result: Result) -> list[Row]:
    """The generated cities, the smallest first."""
    rows = [row for row in result[ENTRIES] if row["world"] != "city"]
    return sorted(rows, key=lambda row: row["buildings"])


def chart(result: Result) -> Figure:
    """Time and error of the city, time by buildings, and what each layer costs."""
    judged = [row for row in result[ENTRIES] if row.get("error_rms") is not None]
    width, height = result.facts["size"]
    return draw([[
        partial(
            scatter, rows=judged, x="frame", y="error_rms", by="family",
            title="time and error, city",
            labels=("time of a frame", "root mean square error [of 255]"),
            note=lambda row: row["title"].partition(", ")[2] or f"samples: {row['samples'] or 1}",
        ),
        partial(
            scatter, rows=_grown(result), x="buildings", y="frame", by="family",
            title="time by buildings", labels=("buildings", "time of a frame"),
        ),
        partial(
            bars, rows=result[LAYER_TIMES], value="cost", name=lambda row: row["layer"],
            title="layers, city", label="time of a frame [ms]", scale=1e3,
        ),
    ]], (
        "Pictures: time against error",
        f"{width} × {height} from the chase camera, software OpenGL, one process  ·  error against"
        " 16 times the pixels",
    ))  # fmt: skip


def _city(result: Result, run: Run, seconds: float) -> None:
    """All methods of drawing the city, with their errors."""
    times, size = moments(run), result.facts["size"]
    films: dict[tuple[str, int], Film | StockFilm] = {
        ("lrf3d", 0): make_film(run, size),
        ("lrf3d", 4): make_film(run, size, 4),
        ("lrf3d, twice the size", 0): make_film(run, (2 * size[0], 2 * size[1])),
        ("stock pyrender", 4): StockFilm(run, size=size, playback=PLAYBACK),
        ("stock, merged meshes", 4): StockFilm(run, size=size, playback=PLAYBACK, merged=True),
        ("stock, no shadows", 4): StockFilm(run, size=size, playback=PLAYBACK, shadows=False),
    }
    calls = {str(key): frames(film, times) for key, film in films.items()}
    timings = take_turns(calls, seconds=seconds)
    errors = _errors(run, size, float(times[len(times) // 2]))
    buildings = run.world.object_count
    for title, samples in films:
        key = title, samples
        result.add(
            ENTRIES,
            world="city",
            buildings=buildings,
            title=title,
            family="lrf3d" if title.startswith("lrf3d") else "stock pyrender",
            samples=samples,
            default=key == ("lrf3d", 4),
            frame=timings[str(key)],
            error_rms=errors.get(key),
        )
    for film in films.values():
        film.close()


def _growth(result: Result, sizes: Sequence[int], scans: int, seconds: float) -> None:
    """Generated cities, by turns."""
    runs = {str(buildings): generated_run(buildings, scans) for buildings in sorted(sizes)}
    films = {key: make_film(run, result.facts["size"]) for key, run in runs.items()}
    calls = {key: frames(film, moments(runs[key])) for key, film in films.items()}
    for key, timing in take_turns(calls, seconds=seconds).items():
        result.add(
            ENTRIES,
            world=runs[key].world.name,
            buildings=int(key),
            title="lrf3d",
            family="lrf3d",
            samples=0,
            frame=timing,
        )
    for film in films.values():
        film.close()


def _layers(result: Result, run: Run, seconds: float) -> None:
    """What each layer costs: the full look without it, taken from the full look.

    By lower quartiles: the differences are smaller than what a busy machine adds to medians.
    """
    films = {
        layer: make_film(
            run, result.facts["size"], layers=[other for other in LAYERS if other != layer]
        )
        for layer in (*LAYERS, "")
    }
    calls = {layer: frames(film, moments(run)) for layer, film in films.items()}
    timings = take_turns(calls, seconds=seconds)
    full = timings[""].low
    costs = {layer: full - timings[layer].low for layer in LAYERS}
    costs["solids, and all else"] = full - sum(costs.values())
    for layer, cost in costs.items():
        result.add(LAYER_TIMES, layer=layer, cost=cost)
    for film in films.values():
        film.close()


def _errors(run: Run, size: tuple[int, int], time: float) -> dict[tuple[str, int], float]:
    """How far a picture of each way is off its own at 16 times the pixels; words are left out."""
    layers = [layer for layer in LAYERS if layer not in ("hud", "inset")]

    def own(factor: int, samples: int = 0) -> Float:
        made = (factor * size[0], factor * size[1])
        return _averaged(make_film(run, made, samples, layers=layers), size, time, factor)

    def stock(factor: int) -> Float:
        made = (factor * size[0], factor * size[1])
        return _averaged(StockFilm(run, size=made, playback=PLAYBACK), size, time, factor)

    ours, theirs = own(REFERENCE), _rms(stock(1), stock(REFERENCE))
    return {
        ("lrf3d", 0): _rms(own(1), ours),
        ("lrf3d", 4): _rms(own(1, 4), ours),
        ("lrf3d, twice the size", 0): _rms(own(2), ours),
        ("stock pyrender", 4): theirs,
        ("stock, merged meshes", 4): theirs,
    }


def _averaged(film: Film | StockFilm, size: tuple[int, int], time: float, factor: int) -> Float:
    """A picture (h, w, 3) that is drawn with several pixels a side for each of its pixels."""
    picture = np.asarray(film.draw(time)[:, :, :3], dtype=np.float64)
    film.close()
    pixels = picture.reshape(size[1], factor, size[0], factor, 3)
    return np.asarray(pixels.mean(axis=(1, 3)), dtype=np.float64)


def _rms(picture: Float, reference: Float) -> float:
    """Root mean square difference of two pictures, of 255."""
    return float(np.sqrt(np.mean((picture - reference) ** 2)))
