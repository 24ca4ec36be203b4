"""Scans in files of arrays, .npz of NumPy or .mat of MATLAB, by the names of the arrays.

Ranges (k, n) are needed; angles (n,), stamps (k,), poses (k, 3), or x, y and theta, may be there.
"""

import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from lrf3d.errors import InputError, one_line
from lrf3d.files import check_ordinary
from lrf3d.io.columns import Columns
from lrf3d.io.laser_log import MOST_READINGS, LaserLog, log_name
from lrf3d.io.npz import DAMAGES, read_arrays
from lrf3d.io.text_layout import meaning


def is_foreign(path: Path) -> bool:
    """Whether a .npz file is not a run of lrf3d."""
    try:
        with zipfile.ZipFile(path) as file:
            return "settings.npy" not in file.namelist()
    except DAMAGES:
        return False


def load_arrays(path: Path, largest_range: float | None) -> LaserLog:
    """Read the scans of a file of arrays; see `load_log`."""
    check_ordinary(path, what="a file of arrays")
    try:
        arrays = read_arrays(path) if path.suffix.lower() == ".npz" else _of_matlab(path)
    except NotImplementedError:
        raise InputError(f"{path}: a .mat file of version 7.3; save it with -v7") from None
    except DAMAGES as error:
        text = one_line(str(error) or type(error).__name__, 200)
        raise InputError(f"{path}: no file of arrays, or damaged ({text})") from None
    columns = Columns(log_name(path), {})
    for name, array in arrays.items():
        role, unit = meaning(name.lower())
        if array.dtype.kind not in "fiu" or not role or array.size > MOST_READINGS:
            continue
        values = np.asarray(array, dtype=np.float64)
        if role == "poses" and values.shape[-1:] == (3,):
            columns.values |= dict(zip(("x", "y", "theta"), values.T, strict=True))
        elif role != "poses":
            columns.values[role] = values if role == "ranges" else values.reshape(-1)
            columns.units |= {role: unit} if unit else {}
    ranges = columns.values.get("ranges")
    if ranges is None or ranges.ndim != 2:
        names = ", ".join(f"{name} {array.shape}" for name, array in arrays.items())
        raise InputError(
            f"{path}: no ranges (scans, beams) among {one_line(names, 200)}; name an array 'ranges'"
        )
    for role, values in columns.values.items():
        if role not in ("ranges", "angles") and len(values) != len(ranges):
            raise InputError(f"{path}: {len(values)} of {role} for {len(ranges)} scans")
    columns.notes.append(f"arrays: {', '.join(columns.values)}")
    return columns.log(largest_range, [], 0)


def _of_matlab(path: Path) -> dict[str, Any]:
    """The arrays of a .mat file, and those in its structures."""
    from scipy.io import loadmat

    found: dict[str, Any] = {}
    for name, value in loadmat(path, simplify_cells=True).items():
        parts = value if isinstance(value, dict) else {name: value}
        found |= {part: np.asarray(each) for part, each in parts.items() if part[:2] != "__"}
    return found
