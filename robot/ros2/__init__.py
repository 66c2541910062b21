"""A robot that runs ROS 2: driven over zenoh, through a bridge or by its own middleware, with nothing of ours on it."""
