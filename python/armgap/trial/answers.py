"""Answer of a method to a case of a trial: named causes with probabilities and sizes, bounds, the gap, and the CPU time.

All methods give answers in one form and are scored by one set of rules. On disk an answer is one JSON file
per case, schema ``armgap.answer/1``.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from armgap.diagnosis.result import GapAtHorizon
from armgap.errors import OptionError

SCHEMA = "armgap.answer/1"
#: Name of an effect, and its joint from 1; None for the whole arm.
Name = tuple[str, int | None]


@dataclass(frozen=True)
class Size:
    """Estimated parameter of a named cause [SI]; sigma is None for a method without standard deviations."""

    value: float
    sigma: float | None = None


@dataclass(frozen=True)
class NamedCause:
    """A cause named by a method under trial.

    Attributes
    ----------
    effect, joint
        Standard name of the effect; joint from 1, None for the whole arm.
    probability : float
        Probability that the method states for the cause, 0 to 1.
    sizes : dict of str to Size
        Estimated parameters of the effect by name, if the method gives any.
    look_alikes : tuple of (effect, joint)
        Effects that the method states as indistinguishable from the cause.
    """

    effect: str
    joint: int | None
    probability: float
    sizes: dict[str, Size] = field(default_factory=dict)
    look_alikes: tuple[Name, ...] = ()

    @property
    def name(self) -> Name:
        """Effect and joint of the named cause."""
        return self.effect, self.joint


@dataclass(frozen=True)
class AbsentEffect:
    """An effect that a method calls absent, with `value` as upper 95 % bound of its size, the parameter `parameter` [SI]."""

    effect: str
    joint: int | None
    parameter: str
    value: float


@dataclass(frozen=True)
class Answer:
    """A method's answer to one case.

    Attributes
    ----------
    method : str
        Name of the method.
    verdict : str
        Verdict: ``"none"``, ``"parameters"``, ``"effect"`` or ``"unexplained"``.
    causes : tuple of NamedCause
        Named causes, the most probable first.
    limits : tuple of AbsentEffect
        Effects that the method calls absent, with bounds.
    reach : GapAtHorizon, optional
        RMS prediction errors of the method's models, if it predicts.
    theta : tuple of float
        Parameters of the arm in the model with causes, in the arm file's order, if the method gives them.
    place : int, optional
        Joint (from 1) with most of the gap, if the method names one.
    error : str, optional
        Reason why the method gave no answer.
    remark : str
        Remark of the method on its answer, in words.
    seconds : float
        CPU time of the method for the case, in one thread [s].
    seal, version : str
        SHA-256 by which the case seals its key; version of the software that answered.
    """

    method: str
    verdict: str
    causes: tuple[NamedCause, ...] = ()
    limits: tuple[AbsentEffect, ...] = ()
    reach: GapAtHorizon | None = None
    theta: tuple[float, ...] = ()
    place: int | None = None
    error: str | None = None
    remark: str = ""
    seconds: float = 0.0
    seal: str = ""
    version: str = ""

    def stamped(self, seal: str, version: str, seconds: float) -> Answer:
        """Return the answer with the case's seal, the version and the CPU time filled in."""
        return replace(self, seal=seal, version=version, seconds=round(seconds, 4))

    def to_json(self) -> str:
        """Return the answer as JSON."""
        return json.dumps({"schema": SCHEMA, **asdict(self)}, indent=1, allow_nan=False) + "\n"

    @classmethod
    def from_json(cls, text: str) -> Answer:
        """Read an answer from JSON.

        Raises
        ------
        ValueError
            The text is not an answer of this schema.
        """
        data = json.loads(text)
        if not isinstance(data, dict) or data.pop("schema", None) != SCHEMA:
            raise ValueError(f"not an answer of schema {SCHEMA}")
        try:
            data["causes"] = tuple(_named(c) for c in data["causes"])
            data["limits"] = tuple(AbsentEffect(**x) for x in data["limits"])
            data["reach"] = GapAtHorizon.read(data["reach"]) if data["reach"] else None
            data["theta"] = tuple(data["theta"])
            return cls(**data)
        except (KeyError, TypeError) as error:
            raise ValueError(f"not a whole answer: {error}") from error


def read_answer(path: Path) -> Answer:
    """Read a method's answer to a case from its JSON file.

    Raises
    ------
    OptionError
        The file is missing, or not an answer.
    """
    try:
        return Answer.from_json(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise OptionError(
            f"cannot be read as an answer ({error})", remedy="delete it and run again", file=path
        ) from None


def _named(data: dict[str, Any]) -> NamedCause:
    sizes = {key: Size(**value) for key, value in data["sizes"].items()}
    alike = tuple((effect, joint) for effect, joint in data["look_alikes"])
    return NamedCause(data["effect"], data["joint"], data["probability"], sizes, alike)
