"""The verbs that serve editors and other programs."""
