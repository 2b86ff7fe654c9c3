"""Conversion of a recording's columns to positions and torques in SI units on one clock."""
