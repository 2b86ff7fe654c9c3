"""The function `inspect` and its result: the inspection of one log."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, field
from typing import Any

from armgap.arm.arm import Arm, checked_arm
from armgap.check.check import Check
from armgap.check.log_checks.data import data_checks
from armgap.check.stage import examine
from armgap.errors import LogShapeError, OptionError
from armgap.files.json_result import JsonResult
from armgap.inspection.channels import JointChannels, joint
from armgap.inspection.excitation import Excitation, excitation
from armgap.inspection.sampling import Sampling, sampling
from armgap.log import gather
from armgap.log.findings import Finding
from armgap.log.log import Log
from armgap.progress import report_progress

__all__ = ["Inspection", "inspect"]

# Horizon of predictions in the checks against the arm file [s].
_HORIZON_S = 0.25
# Part of a log, from its start, to which the checks against the arm file fit parameters; the rest is predicted.
_LEARNT = 0.6


@dataclass(frozen=True)
class Inspection(JsonResult):
    """The inspection of one log, the result of `inspect`.

    Attributes
    ----------
    log : str
        Name of the log.
    columns : dict
        Name of the column in the file for each standard name, such as ``q1``.
    sampling : Sampling
        Rate, jitter and gaps of the samples.
    joints : tuple of JointChannels
        Properties of position and torque of each joint.
    excitation : Excitation, optional
        Excitation of the arm's parameters; None without an arm, and for a serial arm.
    findings : tuple of Finding
        Remarks from reading the log: recognised, changed or unusual contents.
    source : Log
        The log that was inspected, after repairs.
    rotary : bool, optional
        Whether the joints are rotary; None without an arm, and for an arm with rotary and linear joints.
    kind : str
        Kind of the arm; empty without one.
    checks : tuple of Check
        Defects found in the log by itself and in comparison with the arm file.
    """

    log: str
    columns: dict[str, str]
    sampling: Sampling
    joints: tuple[JointChannels, ...]
    excitation: Excitation | None
    findings: tuple[Finding, ...]
    source: Log = field(repr=False, compare=False)
    rotary: bool | None = None
    kind: str = ""
    checks: tuple[Check, ...] = ()

    @property
    def units(self) -> tuple[str, str]:
        """Units of positions and of torques, in words; both the rotary and the linear unit if joints are of unknown or of both kinds."""
        if self.rotary is None:
            return "rad or m", "N m or N"
        return ("rad", "N m") if self.rotary else ("m", "N")

    def to_dict(self) -> dict[str, Any]:
        """Return the inspection as a dict ready for JSON, without the log; infinite numbers become null."""
        found: dict[str, Any] = {"schema": "armgap.inspection/1", "log": self.log, "columns": self.columns}
        found["sampling"] = asdict(self.sampling)
        found["joints"] = [asdict(j) for j in self.joints]
        found["excitation"] = None if self.excitation is None else asdict(self.excitation)
        found["checks"] = [check.to_dict() for check in self.checks]
        found["findings"] = [asdict(f) for f in self.findings]
        plain: dict[str, Any] = _finite(found)
        return plain


def inspect(log: Any, arm: Arm | None = None, *, repair: bool = True) -> Inspection:
    """Inspect a log: columns, sampling, steps, saturation, motion and excitation.

    Parameters
    ----------
    log : Log, path or table
        Log to inspect, or anything that `Log.read` and `Log.from_frame` take.
    arm : Arm, optional
        Arm of the log, needed for the excitation of parameters and for checks against the arm file.
    repair : bool, default True
        Whether unambiguous defects are repaired before figures are computed.

    Returns
    -------
    Inspection

    Raises
    ------
    OptionError
        If `log` is a pattern of file names that stands for several logs.
    LogShapeError
        If the arm has another number of joints.

    Examples
    --------
    >>> t = np.arange(2000) * 1e-3
    >>> found = inspect({"t": t, "q1": np.sin(6 * t), "tau1": np.clip(9 * np.cos(6 * t), -8, 8)})
    >>> round(found.sampling.rate_hz), found.joints[0].flat_tops[0].level
    (1000, 8.0)
    """
    logs = gather(log, arm if arm is None else checked_arm(arm))
    if len(logs) != 1:
        raise OptionError(f"{len(logs)} logs were given", remedy="inspect one at a time")
    [log] = logs
    if arm is not None and log.n_joints != arm.n_joints:
        raise LogShapeError(
            f"has {log.n_joints} joints, the arm has {arm.n_joints}",
            remedy="use the arm file that belongs to this log",
            file=log.path or log.name,
        )
    log, checks = _checked(log, arm, repair=repair)
    steps = log.n_joints + 2
    report_progress(f"inspecting {log.name}", 0.0)
    sampled = sampling(log)
    joints = []
    for j in range(log.n_joints):
        report_progress(f"inspecting {log.name}", (j + 1) / steps)
        joints.append(joint(log, j, arm))
    report_progress(f"inspecting {log.name}", (log.n_joints + 1) / steps)
    return Inspection(
        log=log.name,
        columns=dict(log.columns),
        sampling=sampled,
        joints=tuple(joints),
        excitation=None if arm is None or arm.chain is not None else excitation(log, arm),
        findings=log.findings,
        source=log,
        rotary=None if arm is None or len(set(arm.rotary_joints)) > 1 else arm.rotary,
        kind="" if arm is None else arm.kind,
        checks=checks,
    )


def _checked(log: Log, arm: Arm | None, *, repair: bool) -> tuple[Log, tuple[Check, ...]]:
    """Return the repaired log and its defects; for checks against the arm, parameters from the first part of the log predict the last part."""
    log, checks = data_checks(log, arm, repair=repair)
    if arm is None or arm.chain is not None or log.duration < 4 * _HORIZON_S:
        return log, tuple(checks)
    cut = int(len(log) * _LEARNT)
    parts = [log.part(0, cut, log.name)], [log.part(cut, len(log), log.name)]
    try:
        examined = examine(*parts, arm, horizon=_HORIZON_S, repair=repair)
    except ValueError as error:
        said = Finding("checks", f"not checked against the arm file: {error}")
        return log.with_findings((*log.findings, said)), tuple(checks)
    return log, (*examined.checks, *checks)


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {k: _finite(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(v) for v in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
