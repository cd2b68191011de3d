"""The part of a study that one run is for: cases chosen by condition, and shards."""
