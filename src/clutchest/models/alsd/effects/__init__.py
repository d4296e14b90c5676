"""Effects of the active limited-slip differential."""
