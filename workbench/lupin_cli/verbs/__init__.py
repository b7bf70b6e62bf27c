"""One verb a file; what takes time to import is imported inside the functions: `--help` answers at once."""
