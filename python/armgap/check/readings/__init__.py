"""Alternative readings of a log's columns, each tested against the equation of motion."""
