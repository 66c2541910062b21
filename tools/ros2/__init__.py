"""ROS 2 beside a robot: what there is at an address, and ours offered to a graph."""
