"""Scans: run time and error of the casters, compared with other methods."""
