"""The verbs of an operator, one a file: they command the orchestrator on the network, of any profile."""
