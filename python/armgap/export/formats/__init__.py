"""A corrected model in the formats of simulators, and in the user's own description."""
