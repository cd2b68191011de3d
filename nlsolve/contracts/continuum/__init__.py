"""The contracts of flows: what the material is, where it is and what moves it, and how it is discretised."""
