"""A session in which a person teaches, with an end: practice, demonstration, teaching, proof, and a verdict."""
