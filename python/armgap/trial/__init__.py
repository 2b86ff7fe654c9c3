"""Blind trials: cases made by a physics engine that is not ours, with a sealed key.

MuJoCo (``pip install 'armgap[trial]'``) moves the arm; actuators and encoders are modelled here. Nothing of armgap's own
dynamics takes part, so that a diagnosis cannot be right merely because both sides share an error.
"""

from armgap.trial.case import Case, NoMotionError, make_case, possible
from armgap.trial.engine import TrialEngineMissingError
from armgap.trial.key import Hidden, Key, SealError, open_key

__all__ = [
    "Case",
    "Hidden",
    "Key",
    "NoMotionError",
    "SealError",
    "TrialEngineMissingError",
    "make_case",
    "open_key",
    "possible",
]
