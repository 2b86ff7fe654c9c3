"""Descriptions of robots: URDF and MJCF as a tree of links and joints, and a serial chain out of it."""
