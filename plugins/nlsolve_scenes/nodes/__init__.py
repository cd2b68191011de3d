"""Node sets: rings, rectangles, scattered nodes, and nodes read from files."""
