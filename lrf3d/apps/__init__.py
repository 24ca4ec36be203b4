"""Programs: the command line, sweeps, exports."""
