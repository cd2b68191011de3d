"""A study with all that it needs and its results, packed for somebody else."""
