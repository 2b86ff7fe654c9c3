"""Conversion of a diagnosis to a corrected model."""

from __future__ import annotations

from armgap.arm.arm import Arm, checked_arm
from armgap.diagnosis.nominal import mismatch
from armgap.diagnosis.result import Diagnosis
from armgap.export.chain.planar import correct_planar
from armgap.export.chain.serial import correct_serial
from armgap.export.corrected import Corrected, placed
from armgap.export.errors import ExportError

__all__ = ["STAGES", "correct"]

#: Stages of a diagnosis that can be exported.
STAGES = ("with_causes", "refit")
#: First words of the diagnosis' remark on gains of a position controller that were estimated.
_ESTIMATED_GAINS = "gains of the controller, estimated"


def correct(diagnosis: Diagnosis, arm: Arm, *, stage: str = "with_causes", keep_lengths: bool = False) -> Corrected:
    """Return the corrected model of a diagnosed arm: its estimated parameters, and the causes that were found.

    Parameters
    ----------
    diagnosis : Diagnosis
        Diagnosis of the arm.
    arm : Arm
        Arm file of the diagnosis.
    stage : {"with_causes", "refit"}, default "with_causes"
        Model of the diagnosis to export: re-estimated parameters with the causes, or without causes.
    keep_lengths : bool, default False
        Keep the arm file's length of link 1 of a two-link arm, and change theta2 and theta5 accordingly, in the ratio of their variances. By
        default theta2 and theta5 imply the length, and the dynamics are exactly those of the diagnosis.

    Returns
    -------
    Corrected
        A `CorrectedPlanar`, or a `CorrectedSerial` for an arm of kind ``"serial"``.

    Raises
    ------
    ExportError
        If the diagnosis belongs to another arm, or there is no length to keep.
    """
    _check(diagnosis, checked_arm(arm), stage)
    values = [diagnosis.parameters[stage][name] for name in arm.parameter_names]
    found = diagnosis.causes if stage == "with_causes" else ()
    causes = tuple(single for cause in found for single in cause.by_joint())
    notes = _notes(diagnosis, stage)
    if arm.chain is None:
        return correct_planar(arm, stage, values, causes, notes, diagnosis.verdict, keep_lengths=keep_lengths)
    if any(check.check == "torque_unit" for check in diagnosis.checks):
        notes += (
            "the unit of the torques was taken from the arm file's masses: torques and friction are as far off as these",
        )
    notes += tuple(
        f"{note}; those stated are kept"
        for note in diagnosis.extra.get("notes", ())
        if note.startswith(_ESTIMATED_GAINS)
    )
    if keep_lengths:
        raise ExportError("lengths of serial arms are always kept", remedy="leave out --keep-lengths", file=arm.path)
    return correct_serial(arm, stage, values, causes, notes, diagnosis)


def _check(diagnosis: Diagnosis, arm: Arm, stage: str) -> None:
    if stage not in STAGES:
        raise ExportError(f"`{stage}` is not a stage", remedy=f"stages: {', '.join(STAGES)}")
    if (found := mismatch(diagnosis, arm)) is not None:
        problem, name = found
        raise ExportError(problem, remedy="give the arm file of the diagnosis", file=arm.path, column=name)


def _notes(diagnosis: Diagnosis, stage: str) -> tuple[str, ...]:
    if diagnosis.verdict == "none":
        return ("the diagnosis found no gap: these values differ from the arm file's by what noise allows",)
    if diagnosis.verdict == "unexplained":
        return ("the diagnosis leaves a gap unexplained: these values are the best of a model that does not fit",)
    if diagnosis.verdict == "input":
        return (
            "logs and arm file contradict each other: these values hold for logs that are read as the diagnosis says",
        )
    unsure = [c for c in diagnosis.causes if c.equivalents] if stage == "with_causes" else []
    return tuple(
        f"these logs do not tell {placed(c)} from " + ", ".join(placed(e) for e in c.equivalents) for c in unsure
    )
