"""Drives: integrators of Eq. 2, by run time and by how far the end is off."""
