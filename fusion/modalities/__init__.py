"""From one sensor's message to the array that the networks see, a module for each kind."""
