"""A node in a graph of ROS 2 over rmw_zenoh, without ROS: heard and listed like any other of its nodes."""
