"""Measures the quality: benchmarks, the suite of problems, baselines, brute force."""
