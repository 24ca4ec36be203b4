"""Worlds of small drawings that a test makes."""

import ezdxf
from ezdxf import units

from lrf3d.world import load_world


def svg(folder, body, head='width="1000mm" height="1000mm" viewBox="0 0 10 10"'):
    path = folder / "a.svg"
    path.write_text(f'<svg xmlns="http://www.w3.org/2000/svg" {head}>{body}</svg>')
    return load_world(path)


def dxf(folder, draw, unit=units.M):
    drawing = ezdxf.new()
    drawing.header["$INSUNITS"] = unit
    draw(drawing.modelspace())
    drawing.saveas(folder / "a.dxf")
    return load_world(folder / "a.dxf")
