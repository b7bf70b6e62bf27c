"""What a mission says: YAML, positions, models, and one composed, checked chart."""
