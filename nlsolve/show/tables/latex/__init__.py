"""Tables in LaTeX: the letters, the layout within a column, and what is told of where a table comes from."""
