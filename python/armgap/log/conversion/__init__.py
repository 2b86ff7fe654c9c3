"""From a recording's own columns to positions and torques in SI units on one clock."""
