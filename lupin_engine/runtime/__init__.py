"""The loop between a machine and its plugins: queue, clock, records."""
