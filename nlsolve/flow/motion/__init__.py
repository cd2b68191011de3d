"""What moves with the material: nodes, markers, and strain rates that are accumulated at points."""
