"""Long builds: files that survive being killed, shards, clusters, reuse after a change."""
