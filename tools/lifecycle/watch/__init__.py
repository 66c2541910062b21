"""What is heard and known of a robot that is up, and how `lira status` says it."""
