"""Clusters: work that is spread over processes, on this machine or on others, by Dask."""
