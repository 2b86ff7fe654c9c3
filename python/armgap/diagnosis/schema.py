"""JSON Schema of a diagnosis, made from the types that the diagnosis is written from, in the compiled core and in Python."""

from __future__ import annotations

import json
from typing import Annotated, Any

from armgap import _native
from armgap.check.check import CheckEntry
from armgap.diagnosis.diagnosis import InputSummary, LogRemark
from armgap.diagnosis.drive_chain import ChainEntry
from armgap.diagnosis.provenance import Provenance
from armgap.evidence.laws import Law
from armgap.evidence.plausibility import Plausibility
from armgap.files.json_schema import schema_of

__all__ = ["diagnosis_schema"]

_NAME: Any = Annotated[str, "Name of the arm, from its file."]
_ADDED = {
    "chain": Annotated[
        list[ChainEntry],
        "How much of the gap arises where between command and position; empty without measured torques and second encoders.",
    ],
    "checks": Annotated[list[CheckEntry], "Defects of the input, errors first."],
    "input": Annotated[InputSummary, "What was read."],
    "laws": Annotated[list[Law], "Each cause's law and the data it is drawn through; not of serial arms."],
    "log_findings": Annotated[list[LogRemark], "Remarks on the logs."],
    "plausibility": Annotated[list[Plausibility], "Whether the model with causes is physically possible."],
    "provenance": Annotated[Provenance, "What the result was made from."],
}
_OPTIONAL = {"laws"}


def diagnosis_schema() -> dict[str, Any]:
    """Return the JSON Schema (draft 2020-12) of ``armgap.diagnosis/1``.

    Later versions may add keys, so unknown ones are allowed everywhere.

    Returns
    -------
    dict
        The schema, ready for JSON.
    """
    schema: dict[str, Any] = json.loads(_native.diagnosis_schema())
    definitions = schema["$defs"]
    added = {key: schema_of(kind, definitions) for key, kind in _ADDED.items()}
    schema["properties"] |= added
    schema["required"] = sorted({*schema["required"], *_ADDED} - _OPTIONAL)
    definitions["Verdict"]["oneOf"].append(
        {"const": "input", "type": "string", "description": "Logs and arm file contradict each other."}
    )
    definitions["ArmSummary"]["properties"]["name"] = schema_of(_NAME, definitions)
    definitions["ArmSummary"]["required"].append("name")
    return schema | {"$defs": dict(sorted(definitions.items()))}
