"""Long builds: files that survive a kill, parts (shards), clusters, and reuse after a change."""
