"""Geometry of the plane: arrays, line segments, poses."""
