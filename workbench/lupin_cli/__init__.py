"""The command line: one verb a file. Texts, tables and exit codes; other packages do the work."""
