"""A pad that is there: found, opened, read and made to rumble."""
