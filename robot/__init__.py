"""The physical ROSbot 2.0: drivers of its lidar, camera and base."""
