"""Whether the stage of the chain is right at which a hidden effect sits: ``python -m tests.drive_stage --help``."""
