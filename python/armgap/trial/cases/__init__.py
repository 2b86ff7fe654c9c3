"""Sealed cases of a trial: hidden effects, their visibility, and the files of a case."""
