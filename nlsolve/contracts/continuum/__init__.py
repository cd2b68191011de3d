"""The contracts of flows: cloud, geometry, constitutive law, discretizer, and the terms of the balance of momentum."""
