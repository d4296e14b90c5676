"""Effects of the dry clutch."""
