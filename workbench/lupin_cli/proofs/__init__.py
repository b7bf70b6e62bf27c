"""The verbs that look for runs which nobody has thought of."""
