"""Sweeps: many runs over worlds, settings and seeds, on one machine or on a cluster.

A grid defines what is varied, a plan lists all runs with unique keys, Dask distributes them to
processes, and Parquet stores each result once. Results do not depend on where or when they are
computed.
"""
