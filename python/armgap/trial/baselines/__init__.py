"""Baselines: other methods that name causes of sealed cases, for comparison; one file each, listed in `BASELINES`."""

from armgap.trial.baselines.all import BASELINES

__all__ = ["BASELINES"]
