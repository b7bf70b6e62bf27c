"""Composition: documents with positions become one chart, every name resolved and every expression typed."""
