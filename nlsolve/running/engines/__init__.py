"""Engines run cases and yield their parts: one after the other in this process, or side by side in worker processes."""
