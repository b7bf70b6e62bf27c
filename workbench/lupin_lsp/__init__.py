"""What editors need: a schema of the language, and a language server."""
