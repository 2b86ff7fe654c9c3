"""Checks of one log by itself, before the equation of motion."""
