"""Fault tests: streams, blocks, thresholds from a false-alarm rate, isolation, trouble codes."""
