"""Matching scans: which walls two scans share, and the pose of one as seen from the other."""
