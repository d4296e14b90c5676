"""One module per kind of log file that can be written."""
