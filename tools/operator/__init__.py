"""What a person at the robot sees, hears and feels: one state, one voice, whichever screen or pad it comes from."""
