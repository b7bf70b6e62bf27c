"""What always holds, whatever the world does: properties, and the ways to look for their breach."""
