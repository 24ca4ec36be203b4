"""How long does a frame take, beside stock pyrender, and how far is it from a supersampled one?

The city is drawn with and without smoothing, and layer by layer; generated cities show how the time
grows with the buildings. The error of a picture is its distance from the same picture drawn with 16
times the pixels and averaged.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import cycle
from typing import Annotated

import numpy as np

from benchmarks.report import Figure, Report, numbers, scatter
from benchmarks.stock_pyrender import StockFilm
from benchmarks.timing import take_turns
from lrf3d.geometry.lines import Float
from lrf3d.robot import follow_route
from lrf3d.simulation.recorder import simulate
from lrf3d.simulation.run import Run
from lrf3d.simulation.scenario import load_scenario
from lrf3d.studio.render.film import Film
from lrf3d.studio.scene.moments import LAYERS
from lrf3d.world.generators import BLOCK_SIDE, city_blocks, generate_city

SCANS = 60
"""Scans of a run."""

MOMENTS = 24
"""Moments that are drawn in turn."""

PLAYBACK = 4.0
"""Seconds of a run in a second of film."""

FACTOR = 4
"""Pixels a side of the reference for each pixel."""

WORDS = ("hud", "inset")
"""Layers that are left out where pictures are compared: their size is in pixels."""


def bench(
    *,
    buildings: Annotated[str, "Sizes of the cities."] = "40,400,4000",
    seconds: Annotated[float, "Time for all [s]."] = 90.0,
    width: Annotated[int, "Width of the pictures, 16 to 9 [pixels]."] = 1280,
    figure: Figure = None,
) -> Report:
    """Draw frames with lrf3d and with stock pyrender: run time against error."""
    from lrf3d.studio.render.gl import require_gl

    require_gl()
    report = Report(__doc__.splitlines()[0])
    scenario = load_scenario("city")
    drive = scenario.trajectory().poses[:SCANS]
    city = simulate(scenario.world, drive, scenario.lrf, caster="planar", rng=0)
    size = (width, width * 9 // 16)
    smoothing(report, city, size, seconds / 2)
    layers(report, city, size, seconds / 4)
    counts = numbers("--buildings", buildings, least=4)
    films = {str(count): film_of(generated_run(count), size) for count in counts}
    timed = take_turns({key: frames(film) for key, film in films.items()}, seconds=seconds / 4)
    for key, timing in timed.items():
        report.add("frames by buildings", buildings=int(key), frame_s=timing.median)
    report.notes.append(
        f"frames of {size[0]} × {size[1]} from the chase camera, one process, the median. error:"
        f" root mean\nsquare of the differences, of 255, from {FACTOR**2} samples a pixel."
    )
    if figure is not None:
        labels = "time of a frame [s]", "root mean square error [of 255]"
        scatter(figure, report.tables["frames"], "frame_s", "error", "drawn_by", labels, "samples")
    return report


def smoothing(report: Report, run: Run, size: tuple[int, int], seconds: float) -> None:
    """Time and error of each way to draw the city."""
    makers: dict[tuple[str, int], Callable[..., Film | StockFilm]] = {
        ("lrf3d", 0): lambda size=size, shown=LAYERS: film_of(run, size, 0, shown),
        ("lrf3d", 4): lambda size=size, shown=LAYERS: film_of(run, size, 4, shown),
        ("stock pyrender", 4): lambda size=size, shown=(): StockFilm(
            run, size=size, playback=PLAYBACK
        ),
    }
    timed = take_turns({str(key): frames(make()) for key, make in makers.items()}, seconds=seconds)
    plain = [layer for layer in LAYERS if layer not in WORDS]
    large = (FACTOR * size[0], FACTOR * size[1])
    for (name, samples), make in makers.items():
        reference = averaged(makers[name, 4 if name != "lrf3d" else 0](large, plain))
        off = averaged(make(size, plain), 1) - reference
        report.add(
            "frames",
            drawn_by=name,
            samples=max(samples, 1),
            frame_s=timed[str((name, samples))].median,
            error=float(np.sqrt(np.mean(off**2))),
        )


def layers(report: Report, run: Run, size: tuple[int, int], seconds: float) -> None:
    """What each layer costs: what a film is spared that does not show it."""
    films = {layer: film_of(run, size, shown=[each for each in LAYERS if each != layer])
             for layer in LAYERS}  # fmt: skip
    films[""] = film_of(run, size)
    calls = {layer: frames(film) for layer, film in films.items()}
    timed = take_turns(calls, seconds=seconds)
    for layer in LAYERS:
        # The differences are smaller than what a busy machine adds to medians.
        report.save(f"{layer}, a frame", timed[layer].low, timed[""].low)


def film_of(
    run: Run, size: tuple[int, int], samples: int = 0, shown: Sequence[str] = LAYERS
) -> Film:
    """A film from the chase camera."""
    return Film(run, size=size, view="chase", samples=samples, playback=PLAYBACK, layers=shown)


def frames(film: Film | StockFilm) -> Callable[[int], object]:
    """What draws one frame after the other, as in a film, whatever number it is called with."""
    times = film.timeline.run.trajectory.times
    order = cycle(np.linspace(times[0], times[-1], MOMENTS).tolist())

    def draw(_: int) -> object:
        return film.draw(next(order))

    return draw


def averaged(film: Film | StockFilm, factor: int = FACTOR) -> Float:
    """A picture (h, w, 3) in the middle of a run, each pixel the mean of several a side."""
    times = film.timeline.run.trajectory.times
    picture = np.asarray(film.draw(float(times[len(times) // 2]))[:, :, :3], dtype=np.float64)
    film.close()
    rows, columns, _ = picture.shape
    pixels = picture.reshape(rows // factor, factor, columns // factor, factor, 3)
    return np.asarray(pixels.mean(axis=(1, 3)), dtype=np.float64)


def generated_run(buildings: int) -> Run:
    """A drive round a corner in the middle of a generated city."""
    heights = np.random.default_rng(0).uniform(5.0, 18.0, buildings)
    world = replace(generate_city(4 * buildings), heights=np.repeat(heights, 4))
    middle = BLOCK_SIDE * ((np.array(city_blocks(4 * buildings)) - 1) // 2 + 0.5)
    route = middle + BLOCK_SIDE * np.array([[-1.0, 0.0], [0.0, 0.0], [0.0, 1.0]])
    drive = follow_route(route, speed=4.0, dt=0.2)
    return simulate(world, drive.poses[:SCANS], caster="planar", rng=0)
