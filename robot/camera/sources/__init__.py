"""The sources of pictures: which address opens which, a module for each kind, and what several read streams with."""
