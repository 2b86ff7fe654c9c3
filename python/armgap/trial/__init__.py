"""Blind trials: cases simulated by an independent physics engine, with a sealed key.

MuJoCo (``pip install 'armgap[trial]'``) moves the arm; actuators and encoders are modelled here. Armgap's
own dynamics take no part, so that a diagnosis cannot be right merely because simulation and diagnosis share an error.
"""

from typing import TYPE_CHECKING

from armgap._renamed import old_names
from armgap.trial.cases.case import Case, NoMotionError, make_case, possible
from armgap.trial.cases.demo import DEMO_SEED, make_demo_case
from armgap.trial.cases.key import HiddenEffect, Key, SealError, open_key
from armgap.trial.simulation.engine import TrialEngineMissingError
from armgap.trial.trial import DEVELOPMENT_SEED, fresh_seed, make_trial, plan_trial

__all__ = [
    "DEMO_SEED",
    "DEVELOPMENT_SEED",
    "Case",
    "HiddenEffect",
    "Key",
    "NoMotionError",
    "SealError",
    "TrialEngineMissingError",
    "fresh_seed",
    "make_case",
    "make_demo_case",
    "make_trial",
    "open_key",
    "plan_trial",
    "possible",
]

if not TYPE_CHECKING:
    __getattr__ = old_names(__name__)
