"""Logs as text, a scan in each line."""
