"""Exports of a mission's record in standard formats."""
