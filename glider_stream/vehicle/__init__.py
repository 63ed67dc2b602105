"""The vehicle: models of its glide, polars, presets, the cost of a leg, calibration."""
