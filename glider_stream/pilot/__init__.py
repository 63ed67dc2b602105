"""What pilots use: files for vehicles and maps, the card, windows, scores of drawn routes."""
