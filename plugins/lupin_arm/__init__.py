"""The arm: presets for missions (fire and forget), and sliders, library and calibration for operators."""
