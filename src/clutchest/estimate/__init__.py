"""The filter over a drive, online and whole, and what comes out of it."""
