"""Where nodes are placed: rings, rectangles, scattered points, files."""
