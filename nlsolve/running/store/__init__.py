"""A results folder: all cases that were ever finished in it, and the tables, frames and report of one study."""
