"""Properties of every step: those that always hold, and those that the author of a mission wrote."""
