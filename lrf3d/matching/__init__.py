"""Matching scans: what two scans show of the same walls, and how one lies to the other."""
