"""One verb a file; slow imports are inside the functions, so that `--help` answers at once."""
