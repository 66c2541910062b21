"""Studies with people: who teaches by which method in which order, what is asked afterwards, what came of it."""
