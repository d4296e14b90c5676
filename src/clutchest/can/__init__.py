"""The bus: log files, databases, decoding and encoding by column."""
