"""Runs and worlds in the browser: played back, or driven by hand."""
