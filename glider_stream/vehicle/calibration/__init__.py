"""Calibration: the values of a vehicle from its own dives."""
