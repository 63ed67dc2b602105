"""The vehicle: models of its glide, their polars and presets, what a leg costs, calibration."""
