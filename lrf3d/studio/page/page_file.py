"""A run as one HTML file: the page, with recorded moments in place of its server."""

import base64
import gzip
import html
import io
import json
import re
from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from lrf3d.base.interrupts import check
from lrf3d.simulation.run import Run
from lrf3d.studio.page.message import Part, Sender, as_bytes, stage_message, times_part
from lrf3d.studio.page.server import PAGE, page_text
from lrf3d.studio.page.session import PageSession, Wanted
from lrf3d.studio.scene.look import SIZE

# The pictures that cameras are recorded for: the page fits the nearer one into its own.
_SIZES = {"wide": SIZE, "tall": SIZE[::-1]}

# Steps in one of the first-seen times: a thousandth of the run is less than a moment.
_SHARES = 2.0 ** np.array([10, 8, 11, 8], np.float32)

# Size from which on numbers take four bytes [m]: two are within a centimetre up to there.
_FAR = 500.0

# Moments that are recorded in a second of the film [1/s].
_RATE = 10.0

# Largest number of moments of a run: longer ones are recorded in larger steps.
_MOST_MOMENTS = 400

# Least size of the largest number of an array.
_LEAST_SIZE = 1e-6


def page_file(run: Run, *, every: int = 1, preview: bytes = b"") -> bytes:
    """A run as HTML that opens without a server and loads nothing else; keeps every n-th moment.

    A PNG picture may be given as preview for messengers and link lists (the Open Graph protocol).
    """
    record = _Record()
    shown = PageSession.played(run, run.playback, record)
    setup = shown.setup()
    stage = shown.scene.stage
    begin, end = setup["story"]
    step = max(setup["speed"] / _RATE, (end - begin) / _MOST_MOMENTS) * every
    # The end of the run is one of the times.
    step = setup["end"] / np.ceil(setup["end"] / step) if setup["end"] else step
    for view in shown.cameras:
        low, high = (begin, end) if view == "story" else (0.0, setup["end"])
        for shape, (width, height) in _SIZES.items():
            record.begin(f"{view} {shape}")
            # All views have their moments at the same times, and share what is seen then.
            for number in range(int(np.floor(low / step)), int(np.ceil(high / step)) + 1):
                check()
                time = float(np.clip(number * step, low, high))
                shown.answer(Wanted(view, time, width, height), 0.0)
    times = np.round(stage.exposure.texels * _SHARES) / _SHARES
    style, halves = times_part(times.astype(np.float32))
    recording = {
        "step": step,
        "views": record.views,
        "times": [style, record.number(halves["0"].view(np.uint16), "times", "times")],
        "arrays": record.places(),
    }
    ground = io.BytesIO()
    Image.fromarray(stage.ground.picture).save(ground, "WEBP", quality=85)
    # Without the time of day, so that a run has one page.
    packed = partial(gzip.compress, compresslevel=9, mtime=0)
    texts = {
        "recording": packed(json.dumps(recording, separators=(",", ":")).encode()),
        "arrays": packed(b"".join(record.blocks.values())),
        "world": packed(stage_message(stage, times=False)),
        "ground": ground.getvalue(),
    }
    data = "".join(
        f'<script type="text/plain" id="{name}">{base64.b64encode(text).decode()}</script>\n'
        for name, text in texts.items()
    )
    # Modules of a page from a disk import no others, so that they are one.
    modules = [(PAGE / name).read_text("utf-8") for name in ("scene.js", "recorded.js", "page.js")]
    script = re.sub(r"^import .*$|^export ", "", "\n".join(modules), flags=re.M)
    style_sheet = (PAGE / "page.css").read_text("utf-8")
    page = re.sub(r'<link rel="modulepreload".*\n', "", page_text(setup))
    parts = {
        '<link rel="stylesheet" href="/lrf3d/page.css">': f"<style>\n{style_sheet}</style>",
        '<script type="module" src="/lrf3d/page.js"></script>': "",
        "</body>": f'{data}<script type="module">\n{script}</script>\n</body>',
    }
    if preview:
        source = f"data:image/png;base64,{base64.b64encode(preview).decode()}"
        named = {"og:title": html.escape(setup["title"]), "og:type": "website", "og:image": source}
        tags = (f'<meta property="{name}" content="{value}">\n' for name, value in named.items())
        parts["</head>"] = f"{''.join(tags)}</head>"
    for old, new in parts.items():
        page = page.replace(old, new)
    return page.encode()


class _Record(Sender):
    """Keeps messages instead of packing them, and each array once."""

    def __init__(self) -> None:
        super().__init__()
        self.views: dict[str, list[Any]] = {}
        # The arrays of each column of a mark: what is alike lies together, and packs well.
        self.blocks: dict[str, bytearray] = {}
        self._arrays: list[tuple[str, tuple[int, ...]]] = []
        self._known: dict[bytes, int] = {}

    def begin(self, view: str) -> None:
        """Begin the record of a view."""
        self._moments = self.views[view] = list[Any]()

    def message(self, parts: Mapping[str, Part], values: Mapping[str, Any]) -> bytes:
        """Keep a message."""
        marks = dict[str, Any]()
        for name, (style, columns) in parts.items():
            marks[name] = {
                **style,
                "columns": [self.number(each, name, key) for key, each in columns.items()],
            }
        self._moments.append({**values, "marks": marks})
        return b""

    def places(self) -> list[list[int]]:
        """Places of arrays in the blocks, one after another.

        Each is where the array starts, its rows and columns, the bytes of a number, and the
        exponent of its unit; 0 bytes are whole numbers of two.
        """
        sizes = [len(block) for block in self.blocks.values()]
        starts = dict(zip(self.blocks, np.cumsum([0, *sizes]).tolist(), strict=False))
        return [[starts[name] + start, *others] for name, (start, *others) in self._arrays]

    def number(self, array: NDArray[Any], name: str, key: str) -> int:
        """The number of an array of a mark in the record."""
        rows = array.reshape(-1, array.shape[-1])
        text = key.encode() + np.array(rows.shape).tobytes() + rows.tobytes()
        if text not in self._known:
            self._known[text] = len(self._arrays)
            self._keep(rows, f"{name} {key}", key)
        return self._known[text]

    def _keep(self, rows: NDArray[Any], name: str, key: str) -> None:
        """Keep an array as differences of its rows, column by column, low bytes first."""
        size = 2
        exponent = 0
        if key == "colours":
            whole = as_bytes(rows)
            size = 1
        elif key == "times":
            whole = rows
            size = 0
        else:
            # In the unit, a power of two, in which the largest number has 15 bits, or 24.
            most = float(np.abs(rows).max(initial=_LEAST_SIZE))
            size, bits = (2, 15) if most < _FAR else (4, 24)
            exponent = int(np.floor(np.log2(most))) + 1 - bits
            whole = np.round(np.ldexp(rows, -exponent)).clip(max=2**bits - 1)
            whole = whole.astype(f"<i{size}").view(f"<u{size}")
        block = self.blocks.setdefault(name, bytearray())
        self._arrays.append((name, (len(block), *whole.shape, size, exponent)))
        steps = np.diff(whole, axis=0, prepend=np.zeros_like(whole[:1]))
        block += steps.T[..., None].copy().view(np.uint8).transpose(0, 2, 1).tobytes()
