"""The corrected model as a chain of bodies and joints."""
