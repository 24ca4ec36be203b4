"""The laboratory: how long everything that lrf3d does takes, and how far it is off.

`scripts/bench` measures, part by part (`scan`, `map`, `drive`, `render`, `score`, `robots`) or as a
whole; `scripts/paper` measures every claim of the paper. The package never imports from here.
"""
