"""The sealed key of a case: hidden effects, and the hash that fixes them beforehand."""

from __future__ import annotations

import hashlib
import json
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from armgap._renamed import old_names
from armgap.errors import OptionError

if not TYPE_CHECKING:
    __getattr__ = old_names(__name__)

KEY_FILE = "key.json"
SCHEMA = "armgap.key/1"


class SealError(OptionError):
    """Error: the key of a case is missing, not the sealed one, or belongs to an arm file without a seal."""


@dataclass(frozen=True)
class HiddenEffect:
    """One hidden effect of a case.

    Attributes
    ----------
    effect : str
        Standard name of the effect.
    joint : int or None
        Joint from 1; None for the whole arm.
    parameters : dict of str to float
        True parameters [SI].
    log : str or None
        Name of the only log in which an event acts; None for an effect that acts in all logs.
    family : str
        ``"library"`` (one of the 24 standard effects), ``"further"`` (a known effect beyond them) or ``"outside"`` (in no library).
    """

    effect: str
    joint: int | None
    parameters: dict[str, float]
    log: str | None = None
    family: str = "library"

    def to_dict(self) -> dict[str, Any]:
        """Return the hidden effect as a JSON object."""
        return {
            "effect": self.effect,
            "joint": self.joint,
            "parameters": self.parameters,
            "log": self.log,
            "family": self.family,
        }


@dataclass(frozen=True)
class Key:
    """Key of a case: its hidden effects and true parameters.

    Attributes
    ----------
    effects : tuple of HiddenEffect
        Hidden effects; empty for a case without effects.
    nominal : {"exact", "off"}
        Whether the arm file's parameters are exact or off.
    theta : tuple of float
        The arm's true parameters: inertial, viscous, Coulomb [SI].
    details : dict
        How the case was made: seed, physics engine, arm and motions; sizes and visibility of the hidden effects.
    nonce : str
        Random text that prevents finding the key from its hash by trying all possible keys.
    """

    effects: tuple[HiddenEffect, ...]
    nominal: str
    theta: tuple[float, ...]
    details: dict[str, Any]
    nonce: str

    def to_json(self) -> str:
        """Return the key as JSON, schema ``armgap.key/1``."""
        data = {
            "schema": SCHEMA,
            "effects": [e.to_dict() for e in self.effects],
            "nominal": self.nominal,
            "theta": list(self.theta),
            "details": self.details,
            "nonce": self.nonce,
        }
        return json.dumps(data, indent=1, allow_nan=False) + "\n"

    @property
    def sha256(self) -> str:
        """SHA-256 of :meth:`to_json`, as stated in the arm file."""
        return hashlib.sha256(self.to_json().encode()).hexdigest()

    @classmethod
    def from_json(cls, text: str) -> Key:
        """Read a key from JSON.

        Raises
        ------
        ValueError
            The text is not a key.
        """
        data = json.loads(text)
        if not isinstance(data, dict) or data.get("schema") != SCHEMA:
            raise ValueError(f"not a key of schema {SCHEMA}")
        return cls(
            effects=tuple(HiddenEffect(**e) for e in data["effects"]),
            nominal=data["nominal"],
            theta=tuple(data["theta"]),
            details=data["details"],
            nonce=data["nonce"],
        )


def open_key(case: str | Path) -> Key:
    """Open the sealed key of a case folder, after checking its hash.

    Parameters
    ----------
    case : path
        Folder with ``arm.toml`` and ``key.json``.

    Raises
    ------
    SealError
        A file is missing, the arm file has no seal, or the key is not the one that was sealed.
    """
    check_seal(case)
    return Key.from_json(_content(Path(case) / KEY_FILE).decode())


def check_seal(case: str | Path) -> str:
    """Check that the key of a case folder is the sealed one, without returning its contents; return its SHA-256.

    Raises
    ------
    SealError
        A file is missing, the arm file has no seal, or the key is not the one that was sealed.
    """
    folder = Path(case)
    seal, found = sealed_hash(folder), hashlib.sha256(_content(folder / KEY_FILE)).hexdigest()
    if found != seal:
        raise SealError(
            f"is not the key that was sealed: its sha256 is {found[:12]}…, arm.toml states {seal[:12]}…",
            remedy="do not trust it; make the case again from its seed",
            file=folder / KEY_FILE,
        )
    return seal


def sealed_hash(case: str | Path) -> str:
    """Return the sha256 by which the arm file of a case folder seals its key.

    Raises
    ------
    SealError
        The arm file cannot be read or states no hash.
    """
    path = Path(case) / "arm.toml"
    try:
        arm = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise SealError(f"cannot be read ({error})", remedy=_CASE_FOLDER, file=path) from error
    seal = arm.get("sealed", {}).get("sha256")
    if not isinstance(seal, str):
        raise SealError("states no [sealed] sha256", remedy=_CASE_FOLDER, file=path)
    return seal


_CASE_FOLDER = "give the folder of a case that the generator made"


def _content(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise SealError(f"cannot be read ({error.strerror})", remedy=_CASE_FOLDER, file=path) from error
