"""The water: frames and domains, currents in closed form and out of ocean files, terrain."""
