"""Puts a robot's processes under systemd, here or on the robot's computer, and takes them away again."""
