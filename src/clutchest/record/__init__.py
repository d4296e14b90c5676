"""What a run leaves behind: files, a recording, reports."""
