"""A robot that fetches parcels from the shelves of a warehouse."""
