"""The base of all packages: errors, settings, checks, arrays, threads, progress, locks, outputs."""
