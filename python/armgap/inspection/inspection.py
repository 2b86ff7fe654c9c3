"""The inspection of one log."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass, field
from typing import Any

from armgap.arm import Arm
from armgap.errors import LogShapeError, OptionError
from armgap.inspection.channels import Joint, joint
from armgap.inspection.excitation import Excitation, excitation
from armgap.inspection.sampling import Sampling, sampling
from armgap.log import Finding, Log, gather
from armgap.progress import tell

__all__ = ["Inspection", "inspect"]


@dataclass(frozen=True)
class Inspection:
    """The result of `inspect`.

    Attributes
    ----------
    log : str
        Name of the log.
    columns : dict
        The file's own names by standard name.
    sampling : Sampling
        When samples were taken.
    joints : tuple of Joint
        Positions and torques of each joint.
    excitation : Excitation, optional
        What the log tells about the arm's parameters; None without an arm.
    findings : tuple of Finding
        What was noticed, recognised or changed while reading.
    source : Log
        The log itself.
    rotary : bool, optional
        Whether the joints turn; None without an arm.
    kind : str
        Kind of the arm; empty without one.
    """

    log: str
    columns: dict[str, str]
    sampling: Sampling
    joints: tuple[Joint, ...]
    excitation: Excitation | None
    findings: tuple[Finding, ...]
    source: Log = field(repr=False, compare=False)
    rotary: bool | None = None
    kind: str = ""

    @property
    def units(self) -> tuple[str, str]:
        """Units of positions and of torques; both kinds without an arm that says which."""
        if self.rotary is None:
            return "rad or m", "N m or N"
        return ("rad", "N m") if self.rotary else ("m", "N")

    def to_dict(self) -> dict[str, Any]:
        """Return the result, ready for JSON, without the log itself; what is infinite becomes null."""
        found: dict[str, Any] = {"schema": "armgap.inspection/1", "log": self.log, "columns": self.columns}
        found["sampling"] = asdict(self.sampling)
        found["joints"] = [asdict(j) for j in self.joints]
        found["excitation"] = None if self.excitation is None else asdict(self.excitation)
        found["findings"] = [asdict(f) for f in self.findings]
        plain: dict[str, Any] = _finite(found)
        return plain

    def to_json(self, indent: int | None = None) -> str:
        """Return the result as JSON."""
        return json.dumps(self.to_dict(), indent=indent, allow_nan=False)


def inspect(log: Any, arm: Arm | None = None) -> Inspection:
    """Say what a log holds.

    Parameters
    ----------
    log : Log, path or table
        The log, or anything that `Log.read` and `Log.from_frame` take.
    arm : Arm, optional
        The arm it belongs to; needed for what the log tells about parameters.

    Returns
    -------
    Inspection

    Raises
    ------
    OptionError
        If a pattern stands for several logs.
    LogShapeError
        If the arm has another number of joints.

    Examples
    --------
    >>> t = np.arange(2000) * 1e-3
    >>> found = inspect({"t": t, "q1": np.sin(6 * t), "tau1": np.clip(9 * np.cos(6 * t), -8, 8)})
    >>> round(found.sampling.rate_hz), found.joints[0].flat_tops[0].level
    (1000, 8.0)
    """
    logs = gather(log, arm)
    if len(logs) != 1:
        raise OptionError(f"{len(logs)} logs were given", remedy="inspect one at a time")
    [log] = logs
    if arm is not None and log.n_joints != arm.n_joints:
        raise LogShapeError(
            f"has {log.n_joints} joints, the arm has {arm.n_joints}",
            remedy="use the arm file that belongs to this log",
            file=log.path or log.name,
        )
    steps = log.n_joints + 2
    tell(f"inspecting {log.name}", 0.0)
    sampled = sampling(log)
    joints = []
    for j in range(log.n_joints):
        tell(f"inspecting {log.name}", (j + 1) / steps)
        joints.append(joint(log, j, arm))
    tell(f"inspecting {log.name}", (log.n_joints + 1) / steps)
    return Inspection(
        log=log.name,
        columns=dict(log.columns),
        sampling=sampled,
        joints=tuple(joints),
        excitation=None if arm is None else excitation(log, arm),
        findings=log.findings,
        source=log,
        rotary=None if arm is None else arm.rotary,
        kind="" if arm is None else arm.kind,
    )


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {k: _finite(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(v) for v in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
