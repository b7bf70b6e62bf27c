"""Escapes text for XML; the standard library's module for that imports a web client."""

from __future__ import annotations

#: Escapes in attributes; in text the first three are enough.
_SIGNS = {"&": "&amp;", "<": "&lt;", ">": "&gt;", '"': "&quot;", "\n": "&#10;", "\r": "&#13;", "\t": "&#9;"}
_IN_TEXT = str.maketrans({sign: _SIGNS[sign] for sign in "&<>"})
_IN_ATTRIBUTES = str.maketrans(_SIGNS)


def escape(text: str) -> str:
    """Return text as it stands between tags."""
    return text.translate(_IN_TEXT)


def quoted(text: str) -> str:
    """Return text as the value of an attribute, with its quotes."""
    return f'"{text.translate(_IN_ATTRIBUTES)}"'
