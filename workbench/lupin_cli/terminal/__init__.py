"""The output of the command line: colours, tables, excerpts of files, live pictures, prompts."""
