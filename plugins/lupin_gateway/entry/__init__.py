"""The way in: connections from their first byte, tokens and links, and the page on which to log in."""
