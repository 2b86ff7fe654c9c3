"""Search for a column by name: exact, without its unit, or by the end of its path."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from armgap.errors import ColumnError
from armgap.log.conversion.spellings import current_of, foreign, is_foreign, stripped, suffixed, unit_behind
from armgap.log.recording import Recording

__all__ = ["QUANTITIES", "Index"]

# Name of the quantity in ROS messages, by group of standard columns, so that `q1=elbow` finds `/joint_states/elbow/position`.
QUANTITIES = {
    "q": "position", "dq": "velocity", "tau": "effort", "q_ref": "reference", "dq_ref": "reference_velocity",
}  # fmt: skip


@dataclass(frozen=True)
class Index:
    """Index of a recording's columns by all names that stand for a column: full name, name without unit, end of a path.

    A column ``q`` stands for ``q1`` where there is no ``q2``: the only joint of an arm.
    """

    recording: Recording
    place: Path | str

    def find(self, name: str, key: str = "", *, within: str | None = None) -> str | None:
        """Return the column that a name stands for; None if there is none.

        Parameters
        ----------
        name : str
            Name to look for.
        key : str
            Standard name of the column, such as ``"q1"``.
        within : str, optional
            Column whose clock comes first when several columns fit.

        Raises
        ------
        ColumnError
            If several columns fit equally well.
        """
        columns = self.recording.columns
        if name in columns:
            return name
        if name == key and name[-1:] == "1" and name[:-1] in columns and f"{name[:-1]}2" not in columns:
            return name[:-1]
        for fits in (
            [c for c in columns if stripped(c)[0] == name],
            [c for c in columns if suffixed(c) != (c, None) and suffixed(c)[0] == name],
            [c for c in columns if stripped(c)[0].endswith("/" + name)],
            [c for c in columns if self._quantity(name, key) and c.endswith(self._quantity(name, key))],
        ):
            if within is not None and len(fits) > 1:
                clock = self.recording.stream_of(within).columns
                fits = [c for c in fits if c in clock] or fits
            if len(fits) > 1:
                listed = ", ".join(f"`{c}`" for c in fits[:8])
                raise ColumnError(
                    f"fits several columns: {listed}",
                    remedy=f"say which one with --columns {key or name}=NAME",
                    file=self.place,
                    column=name,
                )
            if fits:
                return fits[0]
        return None

    def unit(self, column: str, group: str = "") -> str | None:
        """Return the unit that the file states for a column, in its metadata or in the column's name; None if it states none.

        In names of any kind, such as ``torque_mNm``, only the units of the given group of columns are read.
        """
        stated = self.recording.stream_of(column).units.get(column)
        known = stated if stated is not None and not is_foreign(stated) else None
        return known or stripped(column)[1] or suffixed(column)[1] or unit_behind(column, group)

    def foreign_unit(self, column: str, group: str = "") -> str | None:
        """Return the unit that the file states for a column where armgap does not know it, as that of a current among torques; else None."""
        stated = self.recording.stream_of(column).units.get(column)
        if stated is not None and is_foreign(stated):
            return stated
        named = foreign(column)
        if named is not None:
            return named[1]
        return current_of(column) or None if group == "tau" and stated is None else None

    def in_foreign_unit(self, name: str) -> str | None:
        """Return the column that has a name but for a unit that armgap does not know, as ``tau1 [A]``; None if there is none."""
        fits = [c for c in self.recording.columns if (named := foreign(c)) is not None and named[0] == name]
        return fits[0] if len(fits) == 1 else None

    @staticmethod
    def _quantity(name: str, key: str) -> str:
        quantity = QUANTITIES.get(key.rstrip("0123456789"), "")
        return f"/{name}/{quantity}" if quantity else ""
