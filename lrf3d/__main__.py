"""``python -m lrf3d`` is the program ``lrf3d``."""

from lrf3d.cli import main

main()
