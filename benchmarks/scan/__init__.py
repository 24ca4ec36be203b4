"""Scans: casters beside other ways to cast, by run time and error."""
