"""Checks of the input of serial arms, by the weak form of their equation of motion."""
