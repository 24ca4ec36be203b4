"""What stands in a world, painted once: walls, ground, and when the laser first met them."""
