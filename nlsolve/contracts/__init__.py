"""What a plugin promises: one noun a file, from the component that all of them are to rules and problems.

It may import series.
"""
