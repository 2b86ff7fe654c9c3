"""Sub-commands about models: read, simulated, exported, replayed."""
