"""What a run leaves behind: files, a recording to look at, words."""
