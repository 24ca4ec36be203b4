"""Compiled casting: float64 decisions that are exact, and the loops that take them.

None of these functions may ever get ``fastmath``: it would reorder the error-free sums.
"""
