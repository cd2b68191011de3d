"""The first state of a flow where a study leaves the way there open: by what is cheap to solve on the same nodes."""
