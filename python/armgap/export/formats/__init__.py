"""Writing of a corrected model in the formats of simulators, and into the user's own description."""
