"""Motion that follows a plan: the foot in the air, an offset of the CoM, and joint angles."""
