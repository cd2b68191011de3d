"""Figures on paper: how wide they are, by which fonts, in which formats, and what TeX needs of them."""
