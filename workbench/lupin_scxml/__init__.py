"""SCXML: documents read as missions, and missions written as documents."""
