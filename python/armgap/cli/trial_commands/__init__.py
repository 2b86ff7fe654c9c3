"""Sub-commands of ``armgap trial``, one file each."""

from armgap.cli.trial_commands.all import all_of_it
from armgap.cli.trial_commands.make import make
from armgap.cli.trial_commands.run import baselines, former_name, run
from armgap.cli.trial_commands.score import score

__all__ = ["all_of_it", "baselines", "former_name", "make", "run", "score"]
