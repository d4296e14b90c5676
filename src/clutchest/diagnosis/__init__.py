"""Fault tests: what a monitor watches, thresholds from a false-alarm rate, isolation, codes."""
