"""The default mapper: the number of walls right, each in its place and object."""
