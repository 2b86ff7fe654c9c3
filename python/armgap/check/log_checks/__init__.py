"""Checks of a single log on its own, without the equation of motion."""
