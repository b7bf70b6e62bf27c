"""Expressions of the language: a typed, side-effect-free subset of Python, checked at load."""
