"""Missions: a vehicle flies in a true current that differs from the forecast; a pilot plans again and again."""
