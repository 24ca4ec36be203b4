"""Scores of maps of a world, of a log and of single scans."""
