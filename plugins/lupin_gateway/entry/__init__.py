"""Accepts connections and logs people in: the gate of sockets, tokens and invitations, and the login page."""
