"""A chart as a picture: Mermaid and SCXML as text, SVG and PNG drawn without any other program."""
