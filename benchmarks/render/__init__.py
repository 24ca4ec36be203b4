"""Films: what a frame costs, beside stock pyrender, and how clean it is."""
