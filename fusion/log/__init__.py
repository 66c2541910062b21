"""What is kept of a run: labels, steps, counts."""
