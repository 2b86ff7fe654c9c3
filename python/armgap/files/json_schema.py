"""JSON Schema (draft 2020-12) of Python types: `TypedDict`, `Literal`, lists, dicts and plain values, described by `Annotated` texts."""

from __future__ import annotations

import inspect
import types
from typing import (
    Annotated,
    Any,
    Literal,
    NotRequired,
    Union,
    get_args,
    get_origin,
    get_type_hints,
    is_typeddict,
)

__all__ = ["schema_of"]

Schema = dict[str, Any]
_PLAIN = {str: "string", bool: "boolean", int: "integer", float: "number", type(None): "null"}


def schema_of(kind: Any, definitions: dict[str, Schema]) -> Schema:
    """Return the JSON Schema of a Python type.

    Parameters
    ----------
    kind : type
        Type built of `TypedDict`, `Literal`, `Annotated`, `list`, `tuple`, `dict` with keys of str, unions, str, bool, int, float, None and `Any`.
    definitions : dict
        Schemas by name, to which the schemas of `TypedDict` types are added.

    Returns
    -------
    dict
        The schema; a reference into ``#/$defs`` for a `TypedDict`.

    Raises
    ------
    TypeError
        If the type contains any other type.
    """
    origin, parts = get_origin(kind), get_args(kind)
    if kind is Any:
        return {}
    if kind in _PLAIN:
        return {"type": _PLAIN[kind]}
    if is_typeddict(kind):
        if kind.__name__ not in definitions:
            definitions[kind.__name__] = _object(kind, definitions)
        return {"$ref": f"#/$defs/{kind.__name__}"}
    if origin is Annotated:
        return {"description": parts[1], **schema_of(parts[0], definitions)}
    if origin is NotRequired:
        return schema_of(parts[0], definitions)
    if origin is Literal:
        return {"enum": list(parts)}
    if origin in (Union, types.UnionType):
        return {"anyOf": [schema_of(part, definitions) for part in parts]}
    if origin is list:
        return {"type": "array", "items": schema_of(parts[0], definitions)}
    if origin is tuple:
        items = [schema_of(part, definitions) for part in parts]
        return {"type": "array", "prefixItems": items, "minItems": len(items), "maxItems": len(items)}
    if origin is dict and parts[0] is str:
        return {"type": "object", "additionalProperties": schema_of(parts[1], definitions)}
    raise TypeError(f"{kind!r} has no JSON Schema")


def _object(kind: Any, definitions: dict[str, Schema]) -> Schema:
    hints = get_type_hints(kind, include_extras=True)
    return {
        "type": "object",
        "description": inspect.getdoc(kind) or "",
        "properties": {name: schema_of(hint, definitions) for name, hint in hints.items()},
        "required": sorted(name for name, hint in hints.items() if get_origin(hint) is not NotRequired),
    }
