"""State-space exploration: abstract states, moves of the environment, reductions, the explored graph."""
