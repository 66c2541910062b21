"""What trials cost and what they reached: measures, statistics, pairs, effort at equal quality."""
