"""Watching a clutch while it is driven: a bus in, estimates, events and a recording out."""
