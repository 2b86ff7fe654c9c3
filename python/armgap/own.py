"""Former name of the module `armgap.diagnosis.custom_effect`; removed in 0.3.0."""

from armgap._renamed import old_names

__getattr__ = old_names(__name__)
