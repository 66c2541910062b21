"""The digital twin of the ROSbot in pybullet: worlds, sensors, drive."""
