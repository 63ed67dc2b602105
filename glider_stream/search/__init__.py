"""Routes over a roadmap: queries, paths, rules of surfacing, time against energy."""
