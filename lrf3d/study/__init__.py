"""Studies: whole experiments, from a scenario to files."""
