"""A robot that runs ROS 2: driven through zenoh-bridge-ros2dds, with nothing of ours on it."""
