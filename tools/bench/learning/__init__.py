"""Benchmarks of deciding and learning: from a picture to a decision, a training step, the labels, whole trials."""
