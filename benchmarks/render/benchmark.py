"""``scripts/bench render``: what does a picture cost, beside stock pyrender, and how clean is it?

The city is drawn at both kinds of smoothing, layer by layer, with its floor and with stock
pyrender beside it; generated cities show how the time grows with the buildings. The error of a
picture is its distance from the same picture drawn at 16 times the pixels and averaged.
"""

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from benchmarks.panels import OWN, Bars, Curve, Curves, Rows, TradeOff
from benchmarks.render.savings import ablate_render
from benchmarks.render.scenes import (
    PLAYBACK,
    city_run,
    frames,
    generated_run,
    make_film,
    moments,
)
from benchmarks.render.stock import StockFilm
from benchmarks.results import Ratio, Result
from benchmarks.text import duration, quartiles
from benchmarks.timing import Method, Timing, take_turns
from lrf3d.geometry import Float
from lrf3d.render.film import LAYERS, Film
from lrf3d.simulation import Run
from lrf3d.tables import table

PICTURE = (1280, 720)
"""Width and height of the pictures [pixels]."""

SIZES = (40, 400, 4000)
"""Buildings of the generated cities."""

SECONDS = 90.0
"""Time for all [s], where none is given."""

REFERENCE = 4
"""Pixels a side that a pixel of the reference is the mean of: 16 samples."""


@dataclass(frozen=True, slots=True)
class Drawn:
    """One way to draw one world.

    Args:
        world: Name of the world.
        buildings: How many there are in it.
        title: What draws it.
        samples: Samples a pixel.
        frame: Time of a frame.
        error_rms: Root mean square error of its picture, of 255; None where it was not measured.
    """

    world: str
    buildings: int
    title: str
    samples: int
    frame: Timing
    error_rms: float | None = None


@dataclass(kw_only=True)
class RenderResult(Result):
    """What was measured of pictures.

    Args:
        size: Width and height of the pictures [pixels].
        entries: Each way to draw each world.
        layers_s: What each layer of the full look costs in the city, without smoothing [s].
    """

    benchmark = "render"
    size: tuple[int, int] = PICTURE
    entries: list[Drawn] = field(default_factory=list)
    layers_s: dict[str, float] = field(default_factory=dict)

    def methods(self) -> list[Method]:
        """The methods of drawing the city whose error was measured."""
        found = []
        for entry in self.entries:
            error = entry.error_rms
            if error is None:
                continue
            own = entry.title.startswith("lrf3d")
            _, _, words = entry.title.partition(", ")
            words = words or f"{entry.samples or 1} sample{'s' * (entry.samples > 1)}"
            default = (entry.title, entry.samples) == ("lrf3d", 4)
            family = "lrf3d" if own else "stock pyrender"
            found.append(Method.of("the city", family, words, entry.frame, error, default=default))
        return found

    def tables(self) -> Iterable[str]:
        head = ("drawn by", "world", "buildings", "samples", "frame", "quartiles", "error")
        yield table(head, [
            (
                entry.title,
                entry.world,
                f"{entry.buildings:,}",
                f"{entry.samples}",
                duration(entry.frame.median),
                quartiles(entry.frame.low, entry.frame.high),
                "" if entry.error_rms is None else f"{entry.error_rms:.2f}",
            )
            for entry in self.entries
        ])  # fmt: skip
        yield (
            f"{self.size[0]}x{self.size[1]} from the chase camera, full look, one process; frame:"
            " the median.\nerror: root mean square of a picture's differences, of 255, from the"
            " same way to draw at 16 times\nthe pixels, words left out."
        )
        layers = [(layer, f"{1e3 * took:.2f} ms") for layer, took in self.layers_s.items()]
        yield table(("layer of the city", "time"), layers)

    def panels(self) -> tuple[Rows, tuple[str, str]]:
        floors = {
            f"floor, {entry.samples} samples" if entry.samples else "floor": entry.frame.median
            for entry in self.entries
            if entry.title.startswith("floor")
        }
        grown = sorted(self._grown())
        sizes = Curve(
            "lrf3d", [float(size) for size, _ in grown], [time for _, time in grown], OWN,
            labels=[duration(time) for _, time in grown],
        )  # fmt: skip
        layers = [layer.replace(", ", ",\n") for layer in self.layers_s]
        costs = [1e3 * took for took in self.layers_s.values()]
        row: list[TradeOff | Curves | Bars] = [
            TradeOff("time and error, city", "time of a frame", "root mean square error [of 255]",
                     self.methods(), floors=floors),
            Curves("time by buildings", "buildings", "time of a frame", [sizes], times=True),
            Bars("layers, city", "time of a frame [ms]", layers, {"": (OWN, costs)}, lying=True),
        ]  # fmt: skip
        return [row], (
            "Pictures: time against error",
            f"{self.size[0]} × {self.size[1]} from the chase camera, software OpenGL, one process"
            "  ·  error against 16 times the pixels",
        )

    def _grown(self) -> list[tuple[int, float]]:
        """Buildings of the generated cities, with the time of a frame [s]."""
        return [
            (entry.buildings, entry.frame.median) for entry in self.entries if entry.world != "city"
        ]

    def promised(self) -> list[Ratio]:
        """What is promised of the city on four cores, and of growth."""
        city = {
            (entry.title, entry.samples): entry.frame.median
            for entry in self.entries
            if entry.world == "city"
        }
        ours, full = city["lrf3d", 0], city["lrf3d", 4]
        stock = city["stock pyrender", 4]
        found = [
            Ratio("frame without smoothing, city [ms]", 1e3 * ours, 12.0),
            Ratio("frame with 4 samples, city [ms]", 1e3 * full, 25.0),
            Ratio("stock pyrender / lrf3d, city, both 4 samples", stock / full, 8.0, True),
            Ratio("stock pyrender / lrf3d without smoothing, city", stock / ours, 8.0, True),
        ]
        grown = sorted(self._grown())
        if len(grown) > 1:
            (few, small), (many, large) = grown[0], grown[-1]
            found.append(Ratio(f"frame of {many:,} buildings / of {few:,}", large / small, 1.5))
        return found


def bench_render(
    sizes: Sequence[int] = SIZES,
    *,
    seconds: float = SECONDS,
    size: tuple[int, int] = PICTURE,
    scans: int = 60,
    with_ablation: bool = False,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> RenderResult:
    """Draw the city and generated cities by all methods, and time them in turn.

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
    result = RenderResult(size=size)
    total = 4 if with_ablation else 3
    # Two parts for the city, and one for the layers, for each size and for the ablation.
    share = seconds / (3 + len(sizes) + with_ablation)
    city = city_run(scans)
    _city(result, city, 2.0 * share)
    progress(1, total)
    _layers(result, city, share)
    progress(2, total)
    _growth(result, sizes, scans, share * len(sizes))
    progress(3, total)
    if with_ablation:
        result.savings = ablate_render(city, moments(city), size=size, seconds=share)
        progress(4, total)
    result.ratios = result.promised()
    result.took_s = time.monotonic() - begin
    return result


def _city(result: RenderResult, run: Run, seconds: float) -> None:
    """All methods of drawing the city, with their errors."""
    times, size = moments(run), result.size
    films: dict[tuple[str, int], Film | StockFilm] = {
        ("lrf3d", 0): make_film(run, size),
        ("lrf3d", 4): make_film(run, size, 4),
        ("lrf3d, twice the size", 0): make_film(run, (2 * size[0], 2 * size[1])),
        ("stock pyrender", 4): StockFilm(run, size=size, playback=PLAYBACK),
        ("stock, merged meshes", 4): StockFilm(run, size=size, playback=PLAYBACK, merged=True),
        ("stock, no shadows", 4): StockFilm(run, size=size, playback=PLAYBACK, shadows=False),
    }
    floors = {
        ("floor: clear and read", samples): make_film(run, size, samples) for samples in (0, 4)
    }
    calls = {str(key): frames(film, times) for key, film in films.items()}
    calls |= {str(key): _floor(film) for key, film in floors.items()}
    timings = take_turns(calls, seconds=seconds)
    errors = _errors(run, size, float(times[len(times) // 2]))
    buildings = run.world.object_count
    for key in [*films, *floors]:
        result.entries.append(Drawn("city", buildings, *key, timings[str(key)], errors.get(key)))
    for film in (*films.values(), *floors.values()):
        film.close()


def _growth(result: RenderResult, sizes: Sequence[int], scans: int, seconds: float) -> None:
    """Generated cities, by turns."""
    runs = {str(buildings): generated_run(buildings, scans) for buildings in sorted(sizes)}
    films = {key: make_film(run, result.size) for key, run in runs.items()}
    calls = {key: frames(film, moments(runs[key])) for key, film in films.items()}
    for key, timing in take_turns(calls, seconds=seconds).items():
        result.entries.append(Drawn(runs[key].world.name, int(key), "lrf3d", 0, timing))
    for film in films.values():
        film.close()


def _layers(result: RenderResult, run: Run, seconds: float) -> None:
    """What each layer costs: the full look without it, taken from the full look.

    By lower quartiles: the differences are smaller than what a busy machine adds to medians.
    """
    films = {
        layer: make_film(run, result.size, layers=[other for other in LAYERS if other != layer])
        for layer in (*LAYERS, "")
    }
    calls = {layer: frames(film, moments(run)) for layer, film in films.items()}
    timings = take_turns(calls, seconds=seconds)
    full = timings[""].low
    result.layers_s = {layer: full - timings[layer].low for layer in LAYERS}
    result.layers_s["solids, and all else"] = full - sum(result.layers_s.values())
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


def _floor(film: Film) -> Callable[[int], object]:
    """What clears and reads a picture, and draws nothing."""

    def draw(number: int) -> object:
        film.renderer.begin(film.scenery.scene)
        film.renderer.flatten()
        return film.renderer.finish()

    return draw
