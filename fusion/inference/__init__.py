"""Networks as they drive: the forward pass in numpy and their files, without torch."""
