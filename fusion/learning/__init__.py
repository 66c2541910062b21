"""From labels to a novice."""
