"""SVG to PNG with a bundled typeface: the same on every machine, also on one without any font."""

from __future__ import annotations

from pathlib import Path

from lupin_engine.errors import LupinError

_FONTS = Path(__file__).parent / "fonts"
_MISSING = "PNG needs a package that is not installed: pip install 'lupin-engine[diagram]'; SVG needs none"


def png(svg: str) -> bytes:
    """Return the pixels of an SVG file that `diagram.svg` wrote, one for each of its units.

    Raises:
        LupinError: the package that paints is not installed; the text says how to install it.
    """
    try:
        from resvg_py import svg_to_bytes
    except ImportError:
        raise LupinError(_MISSING) from None
    fonts = sorted(str(font) for font in _FONTS.glob("*.otf"))
    return bytes(svg_to_bytes(svg_string=svg, skip_system_fonts=True, font_files=fonts))
