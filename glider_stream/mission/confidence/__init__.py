"""Answers with confidence: routes flown in all members of an ensemble of currents, and the choice among them."""
