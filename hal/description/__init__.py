"""The robot as ROS sees it, made from its profile: frames, model, what its camera projects, how far odometry drifts."""
