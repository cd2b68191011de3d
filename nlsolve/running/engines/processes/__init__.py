"""Worker processes: what they run, what their runner sees of them, and what goes between the two."""
