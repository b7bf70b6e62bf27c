"""The width of a text in the typeface of the diagrams (Inter), without reading a font."""

from __future__ import annotations

# fmt: off
#: Widths of the signs from the blank to the tilde, in thousandths of the size.
_REGULAR = (
    281, 278, 403, 631, 638, 812, 639, 222, 362, 362, 500, 659, 280, 460, 276, 357, 625, 464, 605, 636,
    642, 608, 624, 571, 616, 624, 276, 280, 659, 659, 659, 507, 936, 676, 651, 727, 719, 598, 587, 743,
    740, 264, 543, 652, 562, 889, 753, 761, 635, 761, 639, 638, 642, 741, 676, 949, 642, 665, 625, 362,
    357, 362, 469, 452, 497, 564, 621, 558, 621, 582, 361, 609, 591, 237, 237, 544, 237, 869, 585, 597,
    609, 609, 372, 523, 364, 581, 557, 812, 540, 557, 541, 362, 327, 362, 659,
)
_BOLD = (
    248, 309, 396, 643, 649, 844, 663, 213, 393, 393, 543, 673, 295, 466, 290, 379, 667, 481, 621, 652,
    666, 632, 648, 587, 646, 648, 290, 295, 673, 673, 673, 544, 999, 724, 657, 744, 724, 608, 586, 755,
    744, 275, 561, 677, 566, 906, 741, 775, 643, 776, 651, 649, 660, 734, 724, 1007, 690, 705, 653, 393,
    379, 393, 481, 468, 497, 575, 630, 577, 630, 593, 377, 625, 613, 261, 261, 569, 261, 898, 610, 608,
    625, 625, 397, 549, 380, 608, 576, 837, 562, 576, 562, 393, 358, 393, 673,
)
# fmt: on
_SIGNS = {"…": 821, "≤": 673, "≥": 673, "→": 955, "\u00d7": 673, "↻": 1000}
#: The width of any other character; none of the bundled ones is wider.
_OTHER = 1020


def text_width(text: str, size: float, bold: bool = False) -> float:
    """Return the width of a line of text, in pixels."""
    widths = _BOLD if bold else _REGULAR
    known = (widths[ord(char) - 32] if " " <= char <= "~" else _SIGNS.get(char, _OTHER) for char in text)
    return sum(known) * size / 1000
