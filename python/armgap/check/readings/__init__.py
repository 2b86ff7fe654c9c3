"""Other readings of a log's columns, each tried against the equation of motion."""
