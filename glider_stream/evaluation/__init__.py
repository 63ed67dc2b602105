"""How good it is: benchmarks, the suite of problems, baselines, brute force."""
