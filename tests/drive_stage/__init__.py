"""Trial of the stages of the drive chain: is the largest share of the gap at the hidden effect's stage? ``python -m tests.drive_stage --help``."""
