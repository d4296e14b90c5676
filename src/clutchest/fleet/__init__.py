"""Many drives of many vehicles of one kind: estimates, wear trends, and vehicles that differ."""
