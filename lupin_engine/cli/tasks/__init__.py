"""What the verbs do: one module a verb, imported when it is called, not for its help."""
