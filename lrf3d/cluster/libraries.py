"""The error that says how to get what clusters and sweeps need beside the rest of lrf3d."""

from lrf3d.errors import MissingLibraryError


def missing_sweep() -> MissingLibraryError:
    """The error that says how to get Dask and Parquet."""
    return MissingLibraryError(
        "sweeps and clusters need Dask and Parquet; pip install 'lrf3d[sweep]'"
    )
