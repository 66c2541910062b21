"""The values as ROS 2 messages in CDR, and back: the types, each family of messages, and the codec over them all."""
