"""The CORE2 base board: rosserial's host side without ROS, and the base behind it."""
