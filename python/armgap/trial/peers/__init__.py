"""Former name of the module `armgap.trial.baselines`; removed in 0.3.0."""

from armgap._renamed import old_names

__getattr__ = old_names(__name__)
