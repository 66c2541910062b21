"""Who may on the bus: keys and when they end, what each peer may do with its own, and who was refused."""
