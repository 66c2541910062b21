"""The bus: one robot's namespace on zenoh, its topics, links, keys and clock."""
