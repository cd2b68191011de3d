"""What a law, a scene and the sizes of its numbers claim, held against the state that was solved."""
