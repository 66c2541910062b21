"""What `lira labels` does with a log of labels."""
