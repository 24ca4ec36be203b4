"""Benchmarks: run time against error, each part a module that measures and reports in one form."""
