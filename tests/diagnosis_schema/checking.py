"""Checks of a diagnosis' JSON: it fits its schema, has no keys beyond those of the schema, and is unchanged when read and written."""

from __future__ import annotations

import functools
import json
from dataclasses import fields, is_dataclass
from typing import Any

import pytest

from armgap.diagnosis import Cause, Diagnosis, diagnosis_schema

#: Fields of the typed result with other keys in the JSON object: class and field, mapped to the path of keys.
ELSEWHERE = {
    ("Gap", "free_run_before"): ("free_run", "before"),
    ("Gap", "free_run_after"): ("free_run", "after"),
    ("Location", "variable"): ("range", "variable"),
    ("Location", "low"): ("range", "from"),
    ("Location", "high"): ("range", "to"),
}


def closed(schema: Any) -> Any:
    """Return the schema without permission for keys that it does not list, so that a key without a type is found."""
    if isinstance(schema, dict):
        inner = {key: closed(value) for key, value in schema.items()}
        return inner | {"additionalProperties": False} if isinstance(schema.get("properties"), dict) else inner
    return [closed(item) for item in schema] if isinstance(schema, list) else schema


@functools.cache
def _validator() -> Any:
    jsonschema: Any = pytest.importorskip("jsonschema", reason="jsonschema is missing: pip install 'armgap[dev]'")
    schema = closed(diagnosis_schema())
    kind = jsonschema.Draft202012Validator
    kind.check_schema(schema)
    return kind(schema)


def misfits(data: Any) -> list[str]:
    """Return the differences of a JSON object from the schema, one text each."""
    return [f"{error.json_path}: {error.message}" for error in _validator().iter_errors(data)]


def losses(text: str) -> list[str]:
    """Return what differs after the text of a diagnosis is read and written again, or between the text and the typed result."""
    data = json.loads(text)
    result = Diagnosis.from_dict(json.loads(text))
    found = [] if result.to_json(indent=None) == text else ["$: the text differs"]
    return found + _differences(result, data, "$")


def _differences(typed: Any, data: Any, place: str) -> list[str]:
    """Return where a typed value differs from its JSON; keys without a field of the type are expected in `Diagnosis.extra`."""
    if is_dataclass(typed) and not isinstance(typed, type):
        found = []
        for field in fields(typed):
            if field.name.startswith("_") or (isinstance(typed, Cause) and field.name == "values"):
                continue
            value = getattr(typed, field.name)
            if isinstance(typed, Cause) and field.name == "parameters" and typed.values:
                value = typed.values
            if field.name == "extra":
                found += [f"{place}.{k}: lost" for k in data if k not in value and k not in _own(typed) | {"schema"}]
                continue
            inner: Any = data
            for key in ELSEWHERE.get((type(typed).__name__, field.name), (field.name,)):
                inner = (inner or {}).get(key)
            found += _differences(value, inner, f"{place}.{field.name}")
        return found
    if isinstance(typed, dict):
        if not isinstance(data, dict) or typed.keys() != data.keys():
            return [f"{place}: other keys"]
        return [line for key in typed for line in _differences(typed[key], data[key], f"{place}.{key}")]
    if isinstance(typed, tuple | list):
        if not isinstance(data, list) or len(typed) != len(data):
            return [f"{place}: {data!r} became {typed!r}"]
        return [
            line
            for i, (a, b) in enumerate(zip(typed, data, strict=True))
            for line in _differences(a, b, f"{place}[{i}]")
        ]
    return [] if typed == data and type(typed) is type(data) else [f"{place}: {data!r} became {typed!r}"]


def _own(typed: Any) -> set[str]:
    return {field.name for field in fields(typed)}
