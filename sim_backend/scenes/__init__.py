"""One floor as two scenes: pybullet's, and a sketch of it in numpy."""
