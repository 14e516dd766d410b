"""Other people's controllers beside ours, on the same robots; tools/benchmark --help."""
