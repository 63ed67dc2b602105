"""What every room stands on: errors, settings, checks, arrays, threads, progress, locks, outputs."""
