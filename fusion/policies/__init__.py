"""Networks, and the files they come from."""
