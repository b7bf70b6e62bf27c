"""Why something that was asked of the arm is not done."""

from __future__ import annotations


class Refused(Exception):
    """A request that is not carried out, and nothing has changed; the text is the answer to who asked."""
