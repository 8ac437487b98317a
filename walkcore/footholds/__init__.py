"""Safe foothold regions (section 5), found by simulating thousands of steps of the whole body."""
