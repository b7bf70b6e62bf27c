"""Converts SVG to PNG with a bundled typeface, so that the result does not depend on installed fonts."""

from __future__ import annotations

from pathlib import Path

from lupin_engine.errors import LupinError

_FONTS = Path(__file__).parent / "fonts"
_MISSING = "PNG needs a package that is not installed: pip install 'lupin-engine[diagram]'; SVG needs none"


def png(svg: str) -> bytes:
    """Return an SVG file of `diagram.svg` as PNG, one pixel a unit.

    Raises:
        LupinError: the renderer is not installed; the text says how to install it.
    """
    try:
        from resvg_py import svg_to_bytes
    except ImportError:
        raise LupinError(_MISSING) from None
    fonts = sorted(str(font) for font in _FONTS.glob("*.otf"))
    return bytes(svg_to_bytes(svg_string=svg, skip_system_fonts=True, font_files=fonts))
