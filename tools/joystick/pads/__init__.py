"""Pads as they are: what the kernel says of a node, what its controls are called, and which of them does what. Pure."""
