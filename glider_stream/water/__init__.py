"""The water: the local frame, the domain, currents (formulas and ocean files) and the terrain."""
