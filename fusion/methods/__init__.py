"""Who drives and what is learned: LIRA-SPF and its rivals."""
