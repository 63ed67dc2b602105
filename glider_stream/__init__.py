"""Underwater glider planning in ocean currents: exact legs, roadmaps, routes."""
