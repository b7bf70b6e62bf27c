"""What a mission does: one pure step from (configuration, event, time) to (configuration, commands)."""
