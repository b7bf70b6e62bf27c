"""The mobile base: navigation over Nav2, its pose, its battery and its emergency stop."""
