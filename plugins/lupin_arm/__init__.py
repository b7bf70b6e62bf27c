"""The arm while on patrol: named presets, sent and not waited for."""
