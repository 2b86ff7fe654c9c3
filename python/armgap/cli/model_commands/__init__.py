"""Sub-commands about models of arms: reading, simulation, export, replay."""
