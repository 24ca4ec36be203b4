"""Maps: their error, and what they cost to make, keep and look up."""
