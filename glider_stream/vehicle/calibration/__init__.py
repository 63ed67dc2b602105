"""A vehicle's own values, out of its own dives."""
