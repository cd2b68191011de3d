"""What a strategy costs by counts and unit costs, what it will cost elsewhere, and where which strategy wins."""
