"""What reads a run: its story, timeline, coverage and figures, a scenario made of it, a debugger."""
