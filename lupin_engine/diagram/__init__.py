"""A chart as a picture: Mermaid and Graphviz text, and SVG where a program for it is installed."""
