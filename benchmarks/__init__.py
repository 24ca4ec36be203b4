"""Benchmarks: run time against error of every part of lrf3d.

`scripts/bench` measures, part by part (`scan`, `map`, `drive`, `render`, `score`, `robots`) or as a
whole; `scripts/paper` measures every claim of the paper. The package never imports from here.

A benchmark is a function that adds rows of named figures to the tables of a `Result`
(`benchmarks.result`); tables on the terminal, JSON, charts, pages and comparisons are made of them.
"""
