"""The nodes of the 3-D scene: robot, footsteps, points of balance, arrows."""
