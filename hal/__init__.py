"""The contract between a robot and whatever drives it: messages, topics, bus, governor, profiles."""
