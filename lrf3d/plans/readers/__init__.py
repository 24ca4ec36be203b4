"""Readers of plans, one module for each format."""
