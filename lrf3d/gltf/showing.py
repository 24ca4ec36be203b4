"""What is to be seen for a while: nodes that have a size then, and none at other times."""

import numpy as np

from lrf3d.gltf.document import KEYS, Document


class Showing:
    """Shows nodes for a while of the animation by giving them a size."""

    def __init__(self, document: Document, start: float, end: float) -> None:
        self._document, self._start, self._end = document, start, end
        self._sizes: dict[tuple[int, ...], int] = {}

    def between(self, node: int, begin: float, end: float) -> None:
        """Show a node from one time to another [s]; all the time if that is all there is."""
        first, last = begin <= self._start, end >= self._end
        if first and last:
            return
        if not first:
            # Programs that play nothing show the start.
            self._document.gltf.nodes[node].scale = [0.0, 0.0, 0.0]
        sizes = (*([] if first else [0]), 1, *([] if last else [0]))
        if sizes not in self._sizes:
            values = np.repeat(np.array(sizes, np.float32)[:, None], 3, axis=1)
            self._sizes[sizes] = self._document.array(values, KEYS)
        times = [self._start, *([] if first else [begin]), *([] if last else [end])]
        keys = np.array(times) - self._start
        inputs = self._document.array(keys.astype(np.float32), KEYS, bounded=True)
        self._document.animate(node, "scale", inputs, self._sizes[sizes], step=True)
