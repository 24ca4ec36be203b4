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


def pdf(folder, content, page="", forms="", root="", layer="(A-WALL)"):
    """A file of a page of 144 by 72 points, with what is drawn on it, and a form F."""
    stream = "<</Length {0}{1}>>\nstream\n{2}\nendstream"
    objects = [
        f"<</Type/Catalog/Pages 2 0 R{root}>>",
        "<</Type/Pages/Kids[3 0 R]/Count 1>>",
        "<</Type/Page/Parent 2 0 R/MediaBox[0 0 144 72]/Contents 4 0 R/Resources<</XObject<</F 5 0"
        f" R>>/Properties<</L 6 0 R/M 7 0 R>>>>{page}>>",
        stream.format(len(content), "", content),
        stream.format(len(forms), "/Type/XObject/Subtype/Form/BBox[0 0 50 50]", forms),
        f"<</Type/OCG/Name{layer}>>",
        "<</Type/OCG/Name(hidden)>>",
    ]
    text, places = "%PDF-1.7\n", []
    for number, body in enumerate(objects, 1):
        places.append(f"{len(text):010} 00000 n \n")
        text += f"{number} 0 obj\n{body}\nendobj\n"
    table = f"xref\n0 {len(objects) + 1}\n0000000000 65535 f \n{''.join(places)}"
    end = f"trailer\n<</Size {len(objects) + 1}/Root 1 0 R>>\nstartxref\n{len(text)}\n%%EOF"
    (folder / "a.pdf").write_text(text + table + end)
    return load_world(folder / "a.pdf", scale=100.0)
