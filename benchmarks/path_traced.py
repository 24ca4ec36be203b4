"""How near is a film's picture to a path-traced one of the same scene?

``python -m benchmarks.path_traced`` draws moments of runs as films do, without beams and
panels, path-traces the same walls, ground, sun and sky with Mitsuba, and prints the mean FLIP
(Andersson et al., 2020) of both. It needs ``pip install mitsuba flip-evaluator``.
"""

import argparse
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from lrf3d.geometry import Float
from lrf3d.io import load_run
from lrf3d.render.film import Film
from lrf3d.run import Run
from lrf3d.scene import look
from lrf3d.scene.camera import Look
from lrf3d.scene.facades import BAYS, ROWS, layers
from lrf3d.scene.ground import bare_ground
from lrf3d.scene.light import sky_light
from lrf3d.scene.stage import paint_stage
from lrf3d.scene.structures import Structures

PICTURE = (640, 360)
"""Width and height of the pictures [pixels]."""

_LAND = 2000.0
"""How far the ground goes [m]."""


def drawn(run: Run, view: str, time: float) -> tuple[Float, Look, tuple[float, ...]]:
    """A picture (h, w, 3) 0…1 of a run's world alone, the look at it, and the air's haze."""
    film = Film(run, size=PICTURE, view=view, samples=4, layers=())
    look_at = film.camera.look(time, PICTURE[0] / PICTURE[1])
    seen = film.scene.seen(film.timeline.moment(time), look_at, PICTURE, ())
    seen = seen._replace(bodies=(), marks=(), cut=1e4)
    picture = film.renderer.draw(seen)[:, :, :3] / 255.0
    indoor = film.scene.structures.indoor
    haze = (*(look.HAZE_INDOOR if indoor else look.HAZE), seen.lens.thick)
    film.close()
    return picture, look_at, haze


def traced(run: Run, seen: Look, haze: tuple[float, ...], sky: Float, samples: int) -> Float:
    """The same picture, path-traced; where nothing is met, it is that of the sky."""
    import mitsuba as mi

    mi.set_variant("scalar_rgb")
    structures = Structures.from_run(run)
    scene: dict[str, Any] = {"type": "scene", **_walls(mi, structures), **_lamps(mi, structures)}
    scene |= _ground(mi, structures)
    transform = mi.ScalarTransform4f().look_at(
        seen.eye.tolist(), seen.target.tolist(), list(seen.up)
    )
    scene["sensor"] = {
        "type": "perspective", "fov_axis": "y", "fov": float(np.degrees(seen.field)),
        "principal_point_offset_y": 0.5 * seen.shift,
        "near_clip": seen.near, "far_clip": 2.0 * _LAND, "to_world": transform,
        "film": {"type": "hdrfilm", "width": PICTURE[0], "height": PICTURE[1],
                 "pixel_format": "rgba", "rfilter": {"type": "box"}},
    }  # fmt: skip
    scene["integrator"] = {
        "type": "aov",
        "aovs": "place:position",
        "path": {"type": "path", "max_depth": 8, "hide_emitters": True},
    }
    found = np.array(mi.render(mi.load_dict(scene), spp=samples), dtype=np.float64)
    share = found[..., 3:4].clip(0.0, 1.0)
    shown = np.maximum(found[..., :3] / np.maximum(share, 1e-6), 0.0) ** (1.0 / look.GAMMA)
    # Air is no part of the scene: its haze is laid over what was met, as films do.
    way = found[..., 4:7] / np.maximum(share, 1e-6) - seen.eye
    far = (way**2).sum(axis=-1, keepdims=True) * haze[3] ** 2
    hazed = shown + (np.array(haze[:3]) - shown) * far / (1.0 + far)
    return np.asarray(np.clip(share * hazed + (1.0 - share) * sky, 0.0, 1.0))


def flip(one: Float, other: Float) -> float:
    """The mean FLIP of two pictures (h, w, 3) 0…1."""
    import flip_evaluator

    _, mean, _ = flip_evaluator.evaluate(other.astype(np.float32), one.astype(np.float32), "LDR")
    return float(mean)


def _linear(colours: Float) -> Float:
    return np.asarray(np.clip(colours, 0.0, 1.0) ** look.GAMMA)


def _mesh(mi: Any, name: str, corners: Float, uv: Float, colours: Float, bsdf: Any) -> Any:
    """A mesh of triangles (t, 3, …) with colours at its corners."""
    properties = mi.Properties()
    properties["bsdf"] = mi.load_dict(bsdf)
    mesh = mi.Mesh(
        name, 3 * len(corners), len(corners), has_vertex_texcoords=True, props=properties
    )
    mesh.add_attribute("vertex_color", 3, _linear(colours).ravel().astype(np.float32))
    values = mi.traverse(mesh)
    values["vertex_positions"] = corners.ravel().astype(np.float32)
    values["faces"] = np.arange(3 * len(corners), dtype=np.uint32)
    values["vertex_texcoords"] = uv.ravel().astype(np.float32)
    values.update()
    return mesh


def _bitmap(mi: Any, picture: Float, kind: str = "nearest") -> dict[str, Any]:
    bitmap = mi.Bitmap(np.ascontiguousarray(picture.astype(np.float32)))
    return {"type": "bitmap", "bitmap": bitmap, "raw": True, "filter_type": kind}


def _walls(mi: Any, structures: Structures) -> dict[str, Any]:
    """Walls and roofs: what is painted over them, mixed with their own colour by its opacity."""
    rows = paint_stage(structures).faces.rows()[:, [0, 1, 2, 0, 2, 3], :9].reshape(-1, 3, 9)
    rows = rows[(rows[:, 1, :3] != rows[:, 2, :3]).any(axis=1)].astype(np.float64)
    painted = layers(structures.indoor)[0].astype(np.float64) / 255.0
    found = {}
    for layer in np.unique(rows[:, 0, 5]).astype(int).tolist():
        part = rows[rows[:, 0, 5] == layer]
        share = painted[layer, :, :, 3:]
        over = painted[layer, :, :, :3] / np.maximum(1.0 - share, 1e-3)
        colour = {"type": "mesh_attribute", "name": "vertex_color"}
        bsdf = {
            "type": "blendbsdf",
            "weight": _bitmap(mi, share),
            "over": {"type": "diffuse", "reflectance": _bitmap(mi, _linear(over))},
            "wall": {"type": "diffuse", "reflectance": colour},
        }
        uv = part[..., 3:5] / [BAYS, ROWS]
        found[f"walls{layer}"] = _mesh(mi, f"walls{layer}", part[..., :3], uv, part[..., 6:9], bsdf)
    return found


def _ground(mi: Any, structures: Structures) -> dict[str, Any]:
    """The ground in its own colours, and the land around it."""
    ground, bare, land = bare_ground(structures)
    low, high = ground.corner, ground.corner + ground.extent
    found = {}
    for name, reflectance, corner, size, height in (
        ("ground", _bitmap(mi, _linear(bare), "bilinear"), low, high - low, 0.0),
        ("land", {"type": "rgb", "value": _linear(land).tolist()}, low - _LAND,
         high - low + 2.0 * _LAND, -0.02),
    ):  # fmt: skip
        place = mi.ScalarTransform4f().translate([*(corner + 0.5 * size).tolist(), height])
        found[name] = {
            "type": "rectangle",
            "to_world": place.scale([*(0.5 * size).tolist(), 1.0]),
            "bsdf": {"type": "diffuse", "reflectance": reflectance},
        }
    return found


def _lamps(mi: Any, structures: Structures) -> dict[str, Any]:
    """The sky, and among houses the sun."""
    turn, up = np.meshgrid(
        (np.arange(128) + 0.5) / 128 * 2.0 * np.pi, (np.arange(64) + 0.5) / 64 * np.pi
    )
    # Of Mitsuba's sky y is up; the transform turns it to z.
    ways = np.stack(
        [np.sin(turn) * np.sin(up), -np.cos(turn) * np.sin(up), np.cos(up)], axis=-1
    ).reshape(-1, 3)
    local = np.column_stack([ways[:, 0], -ways[:, 1], ways[:, 2]])
    light = sky_light(local, indoor=structures.indoor).reshape(64, 128, 3)
    sky = {
        "type": "envmap",
        "bitmap": mi.Bitmap(np.ascontiguousarray(light.astype(np.float32))),
        "to_world": mi.ScalarTransform4f().rotate([1, 0, 0], 90),
    }
    if structures.indoor:
        return {"sky": sky}
    sun = {
        "type": "directional",
        "direction": (-look.SUN).tolist(),
        "irradiance": {"type": "rgb", "value": (np.pi * look.SUNSHINE).tolist()},
    }
    return {"sky": sky, "sun": sun}


def main() -> None:
    """Compare the pictures that the command line names."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("pictures", nargs="+", metavar="RUN:VIEW:TIME")
    parser.add_argument("--samples", type=int, default=1024, help="Samples a pixel of Mitsuba's.")
    parser.add_argument("--out", type=Path, help="Folder for both pictures, side by side.")
    asked = parser.parse_args()
    found = []
    for picture in asked.pictures:
        path, view, time = picture.rsplit(":", 2)
        run = load_run(Path(path))
        ours, seen, haze = drawn(run, view, float(time))
        reference = traced(run, seen, haze, ours, asked.samples)
        found.append(flip(ours, reference))
        print(f"{run.world.name:20} {view:10} {time:>7} s  FLIP {found[-1]:.3f}", flush=True)
        if asked.out is not None:
            asked.out.mkdir(parents=True, exist_ok=True)
            both = np.round(255.0 * np.concatenate([ours, reference], axis=1)).astype(np.uint8)
            Image.fromarray(both).save(asked.out / f"{run.world.name}-{view}.png")
    print(f"mean FLIP {np.mean(found):.3f}")


if __name__ == "__main__":
    main()
