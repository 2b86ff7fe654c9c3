"""The class `Log`: a checked log of an arm in SI units."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import polars as pl
from numpy.typing import ArrayLike, NDArray

from armgap.errors import ColumnError, OptionError
from armgap.files.output import write
from armgap.log import checks, frames
from armgap.log.conversion import clocks, columns, unit_names, units
from armgap.log.findings import Finding
from armgap.log.formats.all import record
from armgap.log.recording import Recording
from armgap.options import not_an_arm

if TYPE_CHECKING:
    from armgap.arm.arm import Arm

__all__ = ["COLUMNS", "SIGNALS", "Log"]

SIGNALS = ("q", "tau", "dq", "moment", "q_ref", "dq_ref", "tau_meas", "q_link")
"""Names of a log's arrays with one row per sample, apart from its times."""

COLUMNS = tuple(name for name in SIGNALS if name != "moment")
"""Names of a log's arrays that are stored in files, with one column per joint."""

#: Nanoseconds per second; times of a log are rounded to nanoseconds.
_NS = 1e9


@dataclass(frozen=True)
class Log:
    """A log of an arm: one row per sample, everything in SI units.

    Attributes
    ----------
    name : str
        Name of the log in results, usually that of the file.
    t : ndarray, shape (n_samples,)
        Sample times [s], increasing, to the nanosecond; from 0, in a part of a log from the part's time in the whole log.
    q : ndarray, shape (n_samples, n_joints)
        Positions as measured [rad or m].
    tau : ndarray, shape (n_samples, n_joints)
        Torques commanded at `t` and held until the next sample [N m or N]; shape (n_samples, 0) where the log holds references in their place.
    dq : ndarray, shape (n_samples, n_joints), optional
        Velocities, where a sensor gives them [rad/s or m/s].
    findings : tuple of Finding
        Findings from reading the log.
    path : Path, optional
        File that the log was read from.
    columns : mapping
        The file's own name of each column in use, by standard name.
    moment : ndarray, shape (n_samples, n_joints), optional
        First moment of every torque about the middle of its interval, if the torque is a mean over several samples [N m s^2 or N s^2].
    part_of : str, optional
        Name of the whole log, for a part of one.
    first_row : int
        For a part of a log, index of its first row in the whole log, from 0.
    units : mapping
        Unit of each column in the file, by standard name; the arrays are in SI units.
    q_ref, dq_ref : ndarray, shape (n_samples, n_joints), optional
        Reference positions [rad or m] of a position controller, given at `t` and held until the next sample, of a log without torques,
        and reference velocities [rad/s or m/s] if logged.
    tau_meas : ndarray, shape (n_samples, n_joints), optional
        Torques as measured at `t`, from the motors' currents as a rule, in addition to the commanded torques [N m or N].
    q_link : ndarray, shape (n_samples, n_joints), optional
        Positions from second encoders on the link's side of the transmissions [rad or m].
    """

    name: str
    t: NDArray[np.float64]
    q: NDArray[np.float64]
    tau: NDArray[np.float64]
    dq: NDArray[np.float64] | None = None
    findings: tuple[Finding, ...] = ()
    path: Path | None = None
    columns: Mapping[str, str] = field(default_factory=dict)
    moment: NDArray[np.float64] | None = None
    part_of: str | None = None
    first_row: int = 0
    units: Mapping[str, str] = field(default_factory=dict)
    q_ref: NDArray[np.float64] | None = None
    dq_ref: NDArray[np.float64] | None = None
    tau_meas: NDArray[np.float64] | None = None
    q_link: NDArray[np.float64] | None = None

    @classmethod
    def read(
        cls,
        path: str | Path,
        columns: Mapping[str, str] | None = None,
        arm: Arm | None = None,
        *,
        units: Mapping[str, str] | None = None,
    ) -> Log:
        """Read a log from any of the formats in `armgap.log.formats` and check it.

        Parameters
        ----------
        path : path-like
            File, or the folder of a ROS 2 bag; ``-`` reads Parquet or text from standard input.
        columns : mapping, optional
            The file's own names of columns: ``{"q1": "shoulder_position"}``. Adds to the arm file's mapping and wins
            over it.
        arm : Arm, optional
            Arm of the log; its joints, sample period and limits are checked too.
        units : mapping, optional
            Units of the file where they are not SI: ``{"t": "ms", "q": "deg"}``, see `armgap.log.conversion.units.FACTORS` and `COUNTED`. A
            group of columns whose unit is declared is not checked for its magnitude.

        Raises
        ------
        LogReadError, ColumnError, SampleError, TimeError, UnitError, LogShapeError
            If the log cannot be used; the message names file, column and row, and the remedy.
        """
        recording, name, source = record(path)
        return cls._build(recording, name, source, columns, arm, units)

    @classmethod
    def from_frame(
        cls,
        frame: Any,
        *,
        name: str = "log",
        columns: Mapping[str, str] | None = None,
        arm: Arm | None = None,
        units: Mapping[str, str] | None = None,
    ) -> Log:
        """Make a log from a table in memory and check it.

        Parameters
        ----------
        frame : polars.DataFrame, polars.LazyFrame, pandas.DataFrame, pyarrow.Table or mapping
            Table, or a mapping from names to arrays; an array ``q`` of shape (n_samples, n_joints) stands for ``q1``, ``q2`` and so on.
        name : str
            Name of the log in results and errors.
        columns, arm, units
            The table's own names of columns, arm of the log, and units that are not SI, as in `Log.read`.

        Raises
        ------
        OptionError
            If `frame` has none of these types; other errors as for `read`.
        """
        return cls._build(frames.record(frame, name), name, None, columns, arm, units)

    @classmethod
    def from_arrays(
        cls,
        t: ArrayLike,
        q: ArrayLike,
        tau: ArrayLike | None,
        dq: ArrayLike | None = None,
        *,
        q_ref: ArrayLike | None = None,
        dq_ref: ArrayLike | None = None,
        tau_meas: ArrayLike | None = None,
        q_link: ArrayLike | None = None,
        name: str = "log",
        arm: Arm | None = None,
    ) -> Log:
        """Make a log from arrays and check it.

        Parameters
        ----------
        t : array_like, shape (n_samples,)
            Sample times [s].
        q, tau, dq : array_like, shape (n_samples, n_joints), or (n_samples,) for one joint
            Positions [rad or m], torques [N m or N], velocities [rad/s or m/s]; `tau` is None for a log of references.
        q_ref, dq_ref : array_like, as `q` and `dq`, optional
            References of a position controller, used if `tau` is None.
        tau_meas, q_link : array_like, as `tau` and `q`, optional
            Torques as measured, and positions on the link's side of the transmissions.
        name : str
            Name of the log in results and errors.
        arm : Arm, optional
            Arm of the log.

        Raises
        ------
        OptionError
            If the shapes do not fit; other errors as for `read`.
        """
        data: dict[str, NDArray[np.float64]] = {"t": np.asarray(t, dtype=np.float64)}
        given = {
            "q": q, "tau": tau, "dq": dq, "q_ref": q_ref, "dq_ref": dq_ref, "tau_meas": tau_meas, "q_link": q_link,
        }  # fmt: skip
        for prefix, values in given.items():
            if values is None:
                continue
            array = np.asarray(values, dtype=np.float64)
            array = array[:, None] if array.ndim == 1 else array
            if array.ndim != 2 or len(array) != len(data["t"]):
                raise OptionError(
                    f"`{prefix}` has shape {array.shape}, `t` has {len(data['t'])} samples",
                    remedy="give one row per sample and one column per joint",
                )
            data |= {f"{prefix}{j + 1}": array[:, j] for j in range(array.shape[1])}
        return cls._build(frames.record(pl.DataFrame(data), name), name, None, None, arm, None)

    @classmethod
    def _build(
        cls,
        recording: Recording,
        name: str,
        source: Path | None,
        mapping: Mapping[str, str] | None,
        arm: Arm | None,
        declared: Mapping[str, str] | None,
    ) -> Log:
        if not (arm is None or hasattr(arm, "n_joints")):
            raise not_an_arm(arm)
        place = source if source is not None else name
        names, said = columns.resolve(recording, place, mapping or {}, arm)
        scales = units.stated(names, declared or {}, arm, place)
        raw = columns.extract(recording, place, names)
        ticks = clocks.ticks(raw, scales, names, arm, place)
        arrays, timed = clocks.in_seconds(raw, scales, names, arm, place)
        arrays = units.scaled(arrays, scales)
        checks.order(arrays, place, names)
        arrays, cleaned = checks.without_repeats(arrays)
        checks.motion(arrays, place, names)
        declared_only = arrays
        arrays, converted = units.recognised(arrays, names, arm, scales.settled)
        there = unit_names.in_file(
            names, scales, ticks, arm, degrees=(arrays.q is not declared_only.q, arrays.dq is not declared_only.dq)
        )
        units.check(arrays, place, names, arm, scales.settled)
        noticed = [
            *recording.findings, *said, *scales.findings, *timed, *cleaned, *converted,
            *checks.notice(arrays, names, arm), *checks.unused(recording, names),
        ]  # fmt: skip
        arrays.t.__isub__(arrays.t[0])
        log = cls(
            name, arrays.t, arrays.q, arrays.tau, arrays.dq, tuple(noticed), source, names.by_key, units=there,
            q_ref=arrays.q_ref, dq_ref=arrays.dq_ref, tau_meas=arrays.tau_meas, q_link=arrays.q_link,
        )  # fmt: skip
        return log if arm is None or arm.corrections is None else arm.corrections.on_log(log)

    def __post_init__(self) -> None:
        """Round times to whole nanoseconds, so that a log is equal in every file format, and make the arrays read-only."""
        object.__setattr__(self, "t", np.rint(self.t * _NS) / _NS)
        for name in ("t", *SIGNALS):
            values = getattr(self, name)
            if values is not None:
                view = values.view()
                view.flags.writeable = False
                object.__setattr__(self, name, view)

    @property
    def n_joints(self) -> int:
        """Number of joints."""
        return int(self.q.shape[1])

    @property
    def has_torques(self) -> bool:
        """Whether torques are logged, not references of a position controller."""
        return bool(self.tau.shape[1])

    def with_torques(self, use: str) -> Log:
        """Return the log itself if it holds torques.

        Parameters
        ----------
        use : str
            Purpose of the torques, in words, for the error message.

        Raises
        ------
        ColumnError
            If the log holds references in place of torques.
        """
        if not self.has_torques:
            raise ColumnError(
                f"is missing: {use} needs torques, and references do not replace them there",
                remedy="give a log with torques",
                file=self.path or self.name,
                column="tau1",
            )
        return self

    @cached_property
    def sample_period(self) -> float:
        """Median sample period [s]."""
        return float(np.median(np.diff(self.t)))

    @property
    def duration(self) -> float:
        """Duration of the log [s]."""
        return float(self.t[-1] - self.t[0])

    def __len__(self) -> int:
        """Return the number of samples."""
        return len(self.t)

    @property
    def recording(self) -> str:
        """Name of the whole log, for a part of a log too."""
        return self.part_of or self.name

    def _repr_html_(self) -> str:
        """Return length, rate and columns of the log as HTML for a notebook."""
        from armgap.report.forms.shown import log_facts

        return log_facts(self).html()

    def _repr_markdown_(self) -> str:
        """Return length, rate and columns of the log as Markdown."""
        from armgap.report.forms.shown import log_facts

        return log_facts(self).markdown()

    def part(self, first: int, last: int, name: str, *, findings: tuple[Finding, ...] | None = None) -> Log:
        """Return the samples from `first` up to, not including, `last` as a log with unchanged times.

        The part keeps the log's findings unless `findings` are given.
        """
        rows = slice(first, last)
        arrays: dict[str, Any] = {
            key: None if (x := getattr(self, key)) is None else x[rows] for key in ("t", *SIGNALS)
        }
        found = self.findings if findings is None else findings
        return replace(
            self, **arrays, name=name, findings=found, part_of=self.recording, first_row=self.first_row + first
        )

    def with_findings(self, findings: tuple[Finding, ...]) -> Log:
        """Return the log with `findings` in place of its own findings."""
        return replace(self, findings=findings)

    def to_native(self, tables: Sequence[NDArray[np.float64]] = ()) -> tuple[Any, ...]:
        """Return the log as the tuple that the compiled core reads, with the torque `tables`, shape (n_samples,) each, of custom effects."""
        fix = np.ascontiguousarray
        moment, dq_ref = (None if x is None else fix(x) for x in (self.moment, self.dq_ref))
        reference = None if self.q_ref is None or self.has_torques else (fix(self.q_ref), dq_ref)
        return (
            self.name,
            str(self.path or self.part_of or self.name),
            fix(self.t),
            fix(self.q),
            fix(self.tau),
            list(tables),
            moment,
            reference,
        )

    def to_polars(self) -> pl.DataFrame:
        """Return the log as a table with the columns ``t, q1 …, tau1 …`` and the other groups that the log holds, such as ``dq1 …``."""
        data = {"t": self.t}
        for prefix in COLUMNS:
            values = getattr(self, prefix)
            if values is not None:
                data |= {f"{prefix}{j + 1}": values[:, j] for j in range(values.shape[1])}
        return pl.DataFrame(data)

    def write(self, path: str | Path) -> None:
        """Write the log as Parquet, or as CSV if the name ends in ``.csv``; see `armgap.files.output.write`."""
        frame = self.to_polars()
        write(path, frame.write_csv if Path(path).suffix.lower() == ".csv" else frame.write_parquet)
