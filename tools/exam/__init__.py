"""A policy examined without a screen: so many layouts, and a floor for how many it has to pass. For CI."""
