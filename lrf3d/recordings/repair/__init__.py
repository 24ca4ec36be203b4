"""Repairs of recordings: what is wrong with a log is found, corrected and reported."""
