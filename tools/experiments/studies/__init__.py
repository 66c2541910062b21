"""The experiments of the registry, one module each."""
