"""Draws a chart: Mermaid and SCXML as text, SVG and PNG without any other program."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
