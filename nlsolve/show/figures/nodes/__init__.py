"""Figures of the nodes of a flow at one time: clouds, fields and profiles."""
