"""One spoilt case diagnosed: files in a folder of their own, the public `armgap.diagnose`, a record of what came."""

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
#: Of the name of a record without any defect.
WHOLE = "none"
#: Least and largest white noise beside an encoder's rounding [counts].
NOISE = (0.5, 10.0)
#: Differences from the schema, and losses in reading, that a record keeps at most.
PROBLEMS = 10
CAUSE = ("effect", "joint", "probability", "equivalents")


def answer(folder: str, defect: str, seed: int) -> Record:
    """Spoil a case, diagnose it, and return what is to be kept: the answer, and what it should have been.

    Parameters
    ----------
    folder : str
        Of a case that was made.
    defect : str
        Name in the catalogue, or :data:`WHOLE`.
    seed : int
        With the names of case and defect it decides everything random about the defect.
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
    """The inputs with a defect, and what the answer has to say.

    Raises
    ------
    NotApplicableError
        The arm does not have the defect, or the hidden effect is of its kind.
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
    """Version of armgap with a mark of its files: answers of another build are given again."""
    import armgap

    folder = Path(armgap.__file__).parent
    files = sorted(p for p in folder.rglob("*") if p.suffix in (".py", ".so", ".pyd"))
    mark = hashlib.sha256(b"".join(p.read_bytes() for p in files)).hexdigest()
    return f"{armgap.__version__}+{mark[:8]}"


def answer_floor(folder: str, defect: str, seed: int) -> Record:
    """Diagnose a case whose noise is known, half of them with more of it than rounding, and compute its true floor."""
    case = read(Path(folder))
    rng = np.random.default_rng([seed, zlib.crc32(f"{case.name}/noise".encode())])
    counts = float(np.exp(rng.uniform(*np.log(NOISE)))) if rng.uniform() < 0.5 else 0.0
    noise = counts * case.truth.step
    case = measured_again(case, noise, rng)
    answered, cut = diagnosed(case.inputs)
    record = {**about(case), "version": build(), "defect": defect, "noise_counts": counts, **answered}
    # A log that is cut crosswise has another holdout, of which the true arm is not run.
    if cut.keys() == case.inputs.holdout.keys():
        record["true"] = true_floor(case, cut)
    return record


def about(case: Kept) -> Record:
    """What a record says of its case."""
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
    """Write the inputs, diagnose them, and record the answer or the refusal; and where the windows of the holdout start."""
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
    """What holds a diagnosis against its schema: a package beside this one, wherever both are imported from."""
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
    """Starts of the windows of every drawn holdout log."""
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
