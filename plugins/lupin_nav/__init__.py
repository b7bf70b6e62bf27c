"""The mobile base: navigation over Nav2, localization, exploration, battery and emergency stop."""
