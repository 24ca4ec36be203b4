"""lrf3d."""
