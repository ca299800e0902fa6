"""Real-time and throughput figures beside the limits of this machine; run with `python -m benchmarks`."""
