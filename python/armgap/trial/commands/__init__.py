"""Sub-commands of ``armgap trial``, one file each."""

from armgap.trial.commands.all import all_of_it
from armgap.trial.commands.make import make
from armgap.trial.commands.run import baselines, former_name, run
from armgap.trial.commands.score import score

__all__ = ["all_of_it", "baselines", "former_name", "make", "run", "score"]
