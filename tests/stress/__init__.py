"""Stress: whether decisions and numbers hold where they are hardest, as a table.

A `Case` is a row of the table: beams, or whatever else a part of lrf3d takes, of one hard kind,
and how to try some of them. The runner shares the cases of all parts over processes and adds up
their findings. A new part is a module that makes cases, and a line in `running.CASES`.
"""

from stress.cases import Report
from stress.running import CASES, stress

__all__ = ["CASES", "Report", "stress"]
