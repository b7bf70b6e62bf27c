"""The output of proofs: the report page, the evidence, and texts that several verbs share."""
