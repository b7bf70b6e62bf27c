"""The journal: everything that entered a machine, on disk before it counts, and memory made of it."""
