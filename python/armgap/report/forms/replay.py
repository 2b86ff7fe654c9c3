"""Replay of a log: measured and predicted arms side by side, as a recording for the Rerun viewer.

Needs ``pip install 'armgap[rerun]'``. Every window of one horizon starts from the measured state and runs under the logged torque.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from armgap import _native
from armgap.arm.arm import Arm, only_planar
from armgap.errors import ArmgapError, OptionError
from armgap.evidence.hypothesis import Array, Hypothesis
from armgap.files.output import write
from armgap.log.log import Log
from armgap.report import charts

if TYPE_CHECKING:
    from armgap.diagnosis.result import Diagnosis

__all__ = ["RerunMissingError", "models", "poses", "predicted", "write_replay"]

#: Half width of the local cubic that gives initial velocities, in samples.
_INITIAL_VELOCITY_HALF_WIDTH = 8
#: Distance between drawn arms, in reaches of the arm.
APART = 2.4
#: Thickness of a drawn link, as a part of the arm's reach.
THICKNESS = 0.02
COLOURS = {"measured": charts.MEASURED, "arm file": charts.BEFORE, "with causes": charts.AFTER}


class RerunMissingError(ArmgapError, ImportError):
    """Error: a replay was requested but the Rerun SDK is not installed."""


def models(arm: Arm, diagnosis: Diagnosis | None) -> dict[str, Hypothesis]:
    """Return the models that predict a replayed log: the arm file as it is and, from a diagnosis, the model with causes."""
    only_planar(arm, "replay")
    found = {"arm file": Hypothesis(arm, tuple(float(v) for v in arm.theta))}
    if diagnosis is not None:
        data = diagnosis.to_dict()
        kind = (data.get("arm") or {}).get("kind", arm.kind)
        if kind != arm.kind or set(data["parameters"]["with_causes"]) != set(arm.parameter_names):
            raise OptionError("the diagnosis is of another kind of arm", remedy="give the arm file that belongs to it")
        found["with causes"] = Hypothesis.of(data, arm)
    return found


def predicted(model: Hypothesis, log: Log, horizon: float) -> Array:
    """Return predicted positions, shape (n_samples, n_joints); each window starts from the measured state.

    Raises
    ------
    OptionError
        If a window cannot be simulated.
    """
    if not horizon >= log.sample_period:
        remedy = f"give at least the sample period of {log.sample_period:g} s"
        raise OptionError(f"the horizon is {horizon:g} s", remedy=remedy)
    q, t = np.ascontiguousarray(log.q), np.ascontiguousarray(log.t)
    dq = _native.velocity(t, q, "local-cubic", _INITIAL_VELOCITY_HALF_WIDTH)
    starts = np.searchsorted(t, np.arange(t[0], t[-1], horizon))
    found = np.array(q)
    for first, last in zip(starts, [*starts[1:], len(t)], strict=True):
        if last - first < 2:
            continue  # a window of one sample has nothing to predict
        try:
            found[first:last] = model.run(t[first:last], log.tau[first:last], q[first], dq[first])[0]
        except ValueError as error:
            raise OptionError(f"from {t[first]:.3f} s on: {error}", remedy="choose a shorter --horizon") from None
    return found


def poses(arm: Arm, q: Array) -> Array:
    """Return the points of the joints and the tip, base first, shape (n_samples, n_joints + 1, 2) [m].

    Rotary arms hang down at ``q = 0``; further joints turn relative to the preceding link. An axis is a slide along x.

    Raises
    ------
    OptionError
        If an arm of several links does not state their lengths.
    """
    if not arm.rotary:
        return np.stack([np.zeros((len(q), 2)), np.column_stack([q[:, 0], np.zeros(len(q))])], axis=1)
    if arm.link_length is None and arm.n_joints > 1:
        raise OptionError(
            "the link lengths are needed to draw the arm", remedy="add [geometry] link_length", file=arm.path
        )
    length = np.ones(1) if arm.link_length is None else arm.link_length
    angle = np.cumsum(q, axis=1)
    links = length[:, None] * np.stack([np.sin(angle), -np.cos(angle)], axis=-1)
    base = np.zeros((len(q), 1, 2))
    return np.concatenate([base, np.cumsum(links, axis=1)], axis=1)


def write_replay(curves: Mapping[str, Array], log: Log, arm: Arm, path: str | Path) -> None:
    """Write measured and predicted arms as a recording.

    Parameters
    ----------
    curves : mapping of str to ndarray, shape (n_samples, n_joints)
        Predicted positions by the name of their model.
    log : Log
        Measured log.
    arm : Arm
        Arm, for its geometry.
    path : path-like
        Recording to write (``.rrd``).

    Raises
    ------
    RerunMissingError
        If the Rerun SDK is not installed.
    ResultError
        If the recording cannot be written.
    """
    rr, blueprint = _rerun()
    shown = {"measured": log.q, **curves}
    drawn = {name: poses(arm, q) for name, q in shown.items()}
    layout = blueprint.Horizontal(
        blueprint.Spatial2DView(origin="arms", name="measured and predicted"),
        blueprint.Vertical(*(blueprint.TimeSeriesView(origin=f"q{j + 1}") for j in range(arm.n_joints))),
    )
    recording = rr.RecordingStream("armgap")
    memory = recording.memory_recording()  # not to a file of the SDK, so that `write` reports errors
    recording.send_blueprint(layout, make_active=False)
    times = [rr.TimeColumn("time", duration=log.t)]
    for place, (name, q) in enumerate(shown.items()):
        _log_arm(rr, recording, times, name, _picture(drawn[name], place))
        for j in range(arm.n_joints):
            recording.send_columns(f"q{j + 1}/{_entity(name)}", times, rr.Scalars.columns(scalars=q[:, j]), strict=True)
    data = memory.drain_as_bytes()
    recording.disconnect()
    write(path, data)


def _picture(strips: Array, place: int) -> Array:
    """Return links in the viewer's plane, whose y points down, with arm number `place` shifted to its place."""
    reach = float(np.abs(strips).max()) or 1.0
    return np.asarray(strips * [1.0, -1.0] + [APART * reach * place, 0.0], dtype=np.float64)


def _entity(name: str) -> str:
    """Return a name as part of a path in the Rerun recording."""
    return name.replace(" ", "_")


def _log_arm(rr: Any, recording: Any, times: Any, name: str, strips: Array) -> None:
    colour = int(COLOURS[name][1:] + "ff", 16)
    radius = THICKNESS * float(np.ptp(strips, axis=(0, 1)).max() or 1.0)
    style = rr.LineStrips2D.from_fields(colors=[colour], radii=[radius], labels=[name])
    recording.log(f"arms/{_entity(name)}", style, static=True, strict=True)
    columns = rr.LineStrips2D.columns(strips=list(strips.astype(np.float32)))
    recording.send_columns(f"arms/{_entity(name)}", times, columns, strict=True)


def _rerun() -> tuple[Any, Any]:
    try:
        import rerun
        import rerun.blueprint
    except ImportError:
        raise RerunMissingError(
            "a replay needs the Rerun SDK, which is not installed", remedy="pip install 'armgap[rerun]'"
        ) from None
    return rerun, rerun.blueprint
