"""The states of cases: at any point of the material, and as the files and the data sets of other programs."""
