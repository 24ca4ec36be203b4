"""Compiling kernels: once, cached on disk, and without Python's lock while they run.

A kernel is a typed Python function of numbers and arrays that numba compiles to machine code.
"""

from lrf3d.compiling.formulas import LANES, by_lanes, choose
from lrf3d.compiling.kernels import borrower, compiled, entry_of, inner, record

__all__ = [
    "LANES",
    "borrower",
    "by_lanes",
    "choose",
    "compiled",
    "entry_of",
    "inner",
    "record",
]
