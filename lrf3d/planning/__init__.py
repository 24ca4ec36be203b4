"""Planning: routes past most walls of a world, through its free space."""
