"""Benchmarks: run time against error of every part of lrf3d, a script for each question.

`scripts/bench PART` measures one part, `scripts/bench` all that need no file; `scripts/paper`
measures every claim of the paper. Each script has a function ``bench`` whose arguments are its
options and whose rows are printed as tables or as JSON. The package never imports from here.
"""
