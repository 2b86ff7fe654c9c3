"""The JSON Schema of a diagnosis: generated from the types, kept beside the documents, and strict enough to find what is wrong."""

from __future__ import annotations

import copy
import json
from pathlib import Path
from typing import Annotated, Any, Literal, NotRequired, TypedDict

import pytest

from armgap import Arm, _native, diagnose
from armgap.diagnosis import diagnosis_schema, schema
from armgap.files.json_schema import schema_of
from armgap.literals import STATUSES, VERDICTS
from diagnosis_schema.checking import losses, misfits
from swings import swing

KEPT = Path(__file__).parents[1] / "docs" / "reference" / "diagnosis.schema.json"


@pytest.fixture(scope="module")
def data(pendulum: Arm) -> Any:
    return json.loads(diagnose(swing(pendulum, 1), pendulum, max_causes=0).to_json())


def test_the_file_of_the_documents_is_that_of_the_types() -> None:
    assert json.loads(KEPT.read_text(encoding="utf-8")) == diagnosis_schema(), "run tools/diagnosis_schema.py"


def test_words_of_the_core_are_those_of_the_package() -> None:
    definitions = diagnosis_schema()["$defs"]
    for name, words in (("Verdict", VERDICTS), ("Status", STATUSES)):
        assert {choice["const"] for choice in definitions[name]["oneOf"]} == set(words)


def test_no_type_of_the_package_has_the_name_of_one_of_the_core() -> None:
    core = json.loads(_native.diagnosis_schema())["$defs"]
    package: dict[str, Any] = {}
    for kind in schema._ADDED.values():
        schema_of(kind, package)
    assert core.keys() & package.keys() == set()


def test_every_key_and_every_type_is_described() -> None:
    schema = diagnosis_schema()
    described = schema["properties"] | schema["$defs"]
    assert [name for name, entry in described.items() if not entry.get("description")] == []


@pytest.mark.parametrize(
    ("path", "value"),
    [
        (("verdict",), "perhaps"),
        (("schema",), "armgap.diagnosis/2"),
        (("gap", "before"), None),
        (("gap", "before", 0), -1.0),
        (("gap", "unknown"), 1.0),
        (("where", 0, "share"), 1.5),
        (("ruled_out", 0, "status"), "gone"),
        (("ruled_out", 0, "joint"), 0),
        (("parameters", "nominal", "theta1", "sigma"), "small"),
        (("input", "logs", 0, "rows"), 1.5),
        (("provenance", "arm"), {}),
        (("checks",), [{"check": "torque_sign"}]),
    ],
)
def test_what_is_wrong_is_found(data: Any, path: tuple[Any, ...], value: Any) -> None:
    assert misfits(data) == []
    spoilt = copy.deepcopy(data)
    if path[0] == "where":
        spoilt["where"] = [{"joint": 1, "share": 0.5, "regime": "everywhere", "detail": ""}]
        assert misfits(spoilt) == []
    place = spoilt
    for key in path[:-1]:
        place = place[key]
    place[path[-1]] = value
    assert misfits(spoilt) != []


@pytest.mark.parametrize("key", ["verdict", "gap", "where", "parameters", "provenance", "plausibility", "series"])
def test_what_is_missing_is_found(data: Any, key: str) -> None:
    assert misfits({k: v for k, v in data.items() if k != key}) != []


def test_a_reader_that_changes_something_is_found(data: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    from armgap.diagnosis import result

    assert losses(json.dumps(data)) == []
    taken = result._ruled_out
    monkeypatch.setattr(result, "_ruled_out", lambda entry: taken(entry | {"why": "of another kind"}))
    assert any("ruled_out" in line for line in losses(json.dumps(data)))


def test_fields_of_one_name_have_places_of_their_own(data: Any) -> None:
    range_ = {"variable": "dq1", "from": 0.5, "to": 1.5}
    place = {"joint": 1, "share": 0.5, "regime": "fast", "detail": "", "range": range_}
    law = {"x": [0.0, 1.0], "torque": [0.0, 0.1], "sigma": [0.1, 0.1]}
    cells = [[0.0, 0.1], [0.2, 0.3]]
    grid = {"variable": "q2", "unit": "rad", "x": [0.0, 1.0], "y": [0.0, 1.0], "torque": cells, "sigma": cells}
    unnamed = {"joint": 1, "variable": "q1", "unit": "rad", "share": 0.5, "law": law, "grid": grid}
    found = losses(json.dumps(data | {"where": [place], "unnamed": [unnamed]}))
    assert not [line for line in found if "variable" in line]


class Inner(TypedDict):
    """Within."""

    word: Literal["a", "b"]
    size: NotRequired[Annotated[float | None, "How large."]]


def test_a_schema_of_types() -> None:
    definitions: dict[str, Any] = {}
    assert schema_of(list[Inner], definitions) == {"type": "array", "items": {"$ref": "#/$defs/Inner"}}
    assert definitions["Inner"] == {
        "type": "object",
        "description": "Within.",
        "properties": {
            "word": {"enum": ["a", "b"]},
            "size": {"description": "How large.", "anyOf": [{"type": "number"}, {"type": "null"}]},
        },
        "required": ["word"],
    }
    assert schema_of(tuple[int, str], {})["prefixItems"] == [{"type": "integer"}, {"type": "string"}]
    assert schema_of(dict[str, Any], {}) == {"type": "object", "additionalProperties": {}}
    with pytest.raises(TypeError, match="complex"):
        schema_of(complex, {})
