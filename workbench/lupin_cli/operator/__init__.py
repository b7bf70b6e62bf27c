"""The verbs of an operator, one a file: against whatever orchestrator is on the network."""
