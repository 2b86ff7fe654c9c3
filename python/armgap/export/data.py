"""Export of a corrected model as JSON, schema ``armgap.export/1``."""

from __future__ import annotations

import json
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from armgap._native import __version__

if TYPE_CHECKING:
    from armgap.diagnosis.result import Cause
    from armgap.export.corrected import Corrected

__all__ = ["SCHEMA", "render", "to_dict"]

SCHEMA = "armgap.export/1"


def to_dict(model: Corrected) -> dict[str, Any]:
    """Return a corrected model as a JSON object: parameters, links, joints, effects with their fields, and notes."""
    arm = model.arm
    triples = zip(arm.parameter_names, model.theta, model.sigma, arm.parameter_units, strict=True)
    return {
        "schema": SCHEMA,
        "version": __version__,
        "arm": {"name": arm.name, "kind": arm.kind, "gravity": arm.gravity, "sample_period": arm.sample_period},
        "verdict": model.verdict,
        "stage": model.stage,
        "parameters": {n: {"value": float(v), "sigma": float(s), "unit": u} for n, v, s, u in triples},
        **model.data(),
        "joints": [asdict(joint) for joint in model.joints],
        "effects": [_effect(model, cause) for cause in model.causes],
        "notes": list(model.remarks("json")),
    }


def _effect(model: Corrected, cause: Cause) -> dict[str, Any]:
    return {
        "effect": cause.effect,
        "joint": cause.joint,
        **({"joints": list(cause.joints or ()), "row": list(cause.row)} if cause.row else {}),
        "probability": cause.probability,
        "parameters": {name: asdict(value) for name, value in cause.parameters.items()},
        "fields": {form: model.field_of(cause, form) for form in ("mjcf", "urdf", "toml")},
    }


def render(model: Corrected) -> str:
    """Return a corrected model as JSON text."""
    return json.dumps(to_dict(model), indent=2, allow_nan=False) + "\n"
