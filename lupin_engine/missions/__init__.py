"""Folders of mission files: from their names to one checked chart."""
