"""Diagnosis of one case with a defect: files in a temporary folder, the public `armgap.diagnose`, and a record of the answer."""

from __future__ import annotations

import hashlib
import json
import tempfile
import time
import zlib
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from .case import Inputs, NotApplicableError, toml
from .defects import DEFECTS
from .expected import Expected
from .making import Kept, read
from .true_floor import Starts, measured_again, true_floor

Record = dict[str, Any]
#: Name of the defect in the record of a case that has no defect.
WHOLE = "none"
#: Smallest and largest standard deviation of white noise that is added to positions before the encoder rounds them [counts].
NOISE = (0.5, 10.0)
#: Largest number of differences from the JSON Schema, and of losses in reading, that a record keeps.
PROBLEMS = 10
CAUSE = ("effect", "joint", "probability", "equivalents")


def answer(folder: str, defect: str, seed: int) -> Record:
    """Put a defect into a case, diagnose the case, and return the record: the answer, and what it should have been.

    Parameters
    ----------
    folder : str
        Folder of a case that `making.make` has made.
    defect : str
        Name of the defect in the catalogue, or :data:`WHOLE` for none.
    seed : int
        Seed that, with the names of case and defect, decides everything random about the defect.
    """
    case = read(Path(folder))
    record: Record = {**about(case), "version": build(), "defect": defect}
    if defect == WHOLE:
        return {**record, **diagnosed(case.inputs)[0]}
    try:
        inputs, expected = spoilt(case, defect, seed)
    except NotApplicableError as reason:
        return {**record, "skipped": str(reason)}
    return {**record, "expected": expected.to_dict(), **diagnosed(inputs)[0]}


def spoilt(case: Kept, defect: str, seed: int) -> tuple[Inputs, Expected]:
    """Return the inputs of a case with a defect put into them, and what the answer has to say.

    Raises
    ------
    NotApplicableError
        If the defect does not exist on this kind of arm, or the hidden effect equals or hides the defect.
    """
    d = DEFECTS[defect]
    if case.truth.kind not in d.kinds:
        raise NotApplicableError(f"not on {case.truth.kind} arms")
    equal = [effect for effect, _ in case.hidden if effect in d.conflicts]
    if equal:
        raise NotApplicableError(f"the hidden {equal[0]} is of its kind")
    return d.apply(case.inputs, case.truth, np.random.default_rng([seed, zlib.crc32(f"{case.name}/{defect}".encode())]))


@cache
def build() -> str:
    """Return armgap's version with a hash of its files, by which answers of another build are recognised and given again."""
    import armgap

    folder = Path(armgap.__file__).parent
    files = sorted(p for p in folder.rglob("*") if p.suffix in (".py", ".so", ".pyd"))
    mark = hashlib.sha256(b"".join(p.read_bytes() for p in files)).hexdigest()
    return f"{armgap.__version__}+{mark[:8]}"


def answer_floor(folder: str, defect: str, seed: int) -> Record:
    """Diagnose a case and compute its true noise floor; in half of the cases white noise is added to the encoder's rounding."""
    case = read(Path(folder))
    rng = np.random.default_rng([seed, zlib.crc32(f"{case.name}/noise".encode())])
    counts = float(np.exp(rng.uniform(*np.log(NOISE)))) if rng.uniform() < 0.5 else 0.0
    noise = counts * case.truth.step
    case = measured_again(case, noise, rng)
    answered, cut = diagnosed(case.inputs)
    record = {**about(case), "version": build(), "defect": defect, "noise_counts": counts, **answered}
    # A log that is divided into training and holdout stretches has another holdout, for which no true floor is computed.
    if cut.keys() == case.inputs.holdout.keys():
        record["true"] = true_floor(case, cut)
    return record


def about(case: Kept) -> Record:
    """Return the entries of a record that describe its case: arm, hidden effects, visibility, sample period."""
    return {
        "case": case.name,
        "model": case.truth.model,
        "n_joints": case.truth.n_joints,
        "nominal": case.key.nominal,
        "hidden": [list(h) for h in case.hidden],
        "sizes": [h.to_dict() for h in case.key.effects],
        "visible": case.key.details.get("visible", True),
        "period": case.truth.period,
    }


def diagnosed(inputs: Inputs) -> tuple[Record, dict[str, Starts]]:
    """Write the inputs as files and diagnose them; return the answer or the refusal, and the starts of the holdout's windows by log."""
    import armgap

    with tempfile.TemporaryDirectory() as place:
        arm, groups = _write(inputs, Path(place))
        start = time.perf_counter()
        try:
            answered = armgap.diagnose(groups[0], arm, holdout=groups[1])
        except armgap.ArmgapError as error:
            refused = {"type": type(error).__name__, "message": str(error).replace(place, "")}
            return {"verdict": "refused", "refused": refused, "seconds": time.perf_counter() - start}, {}
        seconds, text = time.perf_counter() - start, answered.to_json(indent=None)
        found = json.loads(text)
        problems = [*_schema().misfits(found), *_schema().losses(text)]
        return {**_kept(found), "seconds": seconds, "schema": problems[:PROBLEMS]}, _starts(found["series"])


@cache
def _schema() -> Any:
    """Return the module `diagnosis_schema.checking`, which compares a diagnosis with its JSON Schema, from the folder of this package."""
    beside = (__package__ or "").rpartition(".")[0]
    return import_module(f"{beside}.diagnosis_schema.checking" if beside else "diagnosis_schema.checking")


def _write(inputs: Inputs, place: Path) -> tuple[Path, tuple[list[Path], list[Path]]]:
    arm = place / "arm.toml"
    arm.write_text(toml(inputs.arm), encoding="utf-8")
    paths: tuple[list[Path], list[Path]] = ([], [])
    for group, logs in zip(paths, (inputs.training, inputs.holdout), strict=True):
        for name, table in logs.items():
            group.append(place / f"{name}.parquet")
            table.frame().write_parquet(group[-1])
    return arm, paths


def _kept(found: dict[str, Any]) -> Record:
    return {
        "verdict": found["verdict"],
        "checks": found.get("checks", []),
        "causes": [{key: c[key] for key in CAUSE} for c in found["causes"]],
        "candidates": found.get("candidates", []),
        "gap": {key: found["gap"][key] for key in ("before", "refit", "after", "floor", "closed")},
        "notes": found["notes"],
        "findings": found["log_findings"],
    }


def _starts(series: list[dict[str, Any]]) -> dict[str, Starts]:
    """Return the starts of the windows of every holdout log that the diagnosis has a series of, by log."""
    logs: dict[str, list[dict[str, Any]]] = {}
    for joint in series:
        logs.setdefault(joint["log"], []).append(joint)
    return {
        name: Starts(
            [joints[0]["t"][i] for i in joints[0]["window_start"]],
            np.column_stack([joint["initial_position"] for joint in joints]),
            np.column_stack([joint["initial_velocity"] for joint in joints]),
        )
        for name, joints in logs.items()
    }
