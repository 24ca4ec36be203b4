"""Figures in the style of the documentation."""
