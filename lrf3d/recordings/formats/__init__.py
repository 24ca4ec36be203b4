"""Formats of recorded drives, a module or a room for each."""
