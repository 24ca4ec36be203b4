"""The editor: a person decides in the browser what a plan is, and what a robot does in it."""
