"""The ways to first states: which cases of a run share one, and where they are kept."""
