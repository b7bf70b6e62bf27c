"""Numbers and names as people read them."""

from __future__ import annotations


def number(value: float) -> str:
    """Return a number with four digits, or with all that are before the point as long as they are few."""
    return f"{value:.0f}" if 1e3 <= abs(value) < 1e7 else f"{value:.4g}"


def printable(text: str) -> str:
    """Return what came over the wire without what would be an order to a terminal, or a line of its own."""
    return "".join(letter if letter.isprintable() else "\N{REPLACEMENT CHARACTER}" for letter in text)
