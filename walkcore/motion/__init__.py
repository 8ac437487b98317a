"""From a plan to feet in the air, an offset of the CoM, and joint angles."""
