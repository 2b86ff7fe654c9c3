"""Sub-commands about logs: diagnosis, inspection, identification, planning, comparison, fleets."""
