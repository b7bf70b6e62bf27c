"""The node that runs missions: a machine, its plugins' clients, the journal, and the operator's services."""
