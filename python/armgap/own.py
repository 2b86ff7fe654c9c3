"""Former name of `armgap.diagnosis.custom_effect`; goes with 0.3.0."""

from armgap._renamed import old_names

__getattr__ = old_names(__name__)
