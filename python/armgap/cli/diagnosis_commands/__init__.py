"""Sub-commands about logs: their diagnosis, and what goes before and follows."""
