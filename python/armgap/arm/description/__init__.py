"""Descriptions of robots: URDF and MJCF read as a tree of links and joints and resolved to a serial chain."""
