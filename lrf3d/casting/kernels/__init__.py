"""Compiled casting: exact decisions in float64, and the loops over beams and walls.

None of these functions may ever have ``fastmath``, which would reorder the error-free sums.
"""
