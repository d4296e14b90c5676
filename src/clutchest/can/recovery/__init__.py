"""What can still be read of files that are damaged or end early."""
