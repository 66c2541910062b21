"""What a person runs: the `lira` command and its verbs."""
