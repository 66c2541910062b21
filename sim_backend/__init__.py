"""The digital twin of the ROSbot: worlds, sensors, drive."""
