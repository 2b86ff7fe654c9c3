"""Baselines: other methods that name a cause, answering the same sealed cases; one file each, one line in `BASELINES`."""

from armgap.trial.baselines.all import BASELINES

__all__ = ["BASELINES"]
