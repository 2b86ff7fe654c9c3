"""Sealed cases: what is hidden, whether it can be seen, and the files they come to."""
