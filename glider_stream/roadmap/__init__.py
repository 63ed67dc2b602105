"""The roadmap: its nodes and edges, how they are found, its file."""
