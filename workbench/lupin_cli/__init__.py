"""The command line: one verb a file. Texts, tables and exit codes; the work is done in the other rooms."""
