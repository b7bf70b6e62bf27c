"""What the command line shows: colours, tables, excerpts of files, live pictures, prompts."""
