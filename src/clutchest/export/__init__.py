"""A vehicle's model as C code and as a functional mock-up unit."""
