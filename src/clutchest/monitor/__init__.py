"""Live: a bus in, estimates, events, fault tests and a recording out."""
