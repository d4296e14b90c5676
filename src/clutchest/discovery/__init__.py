"""Discovery: what the simulation gets wrong, why, what to add, and how much that gains."""
