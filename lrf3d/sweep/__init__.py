"""Sweeps: many runs over worlds, settings and seeds, on one machine or on a cluster.

A grid says what is varied, a plan lists every run with a key of its own, Dask spreads them over
processes, and Parquet keeps each result once. No result depends on where or when it was made.
"""
