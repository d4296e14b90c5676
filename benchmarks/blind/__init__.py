"""Causes hidden in simulated drives, and whether `clutchest discover` finds them."""
