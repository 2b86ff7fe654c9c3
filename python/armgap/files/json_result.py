"""Results as JSON text: the method `to_json` of every result."""

from __future__ import annotations

import json
from typing import Any, ClassVar

from armgap.options import indentation

__all__ = ["JsonResult"]


class JsonResult:
    """A result that has a JSON object, by its method `to_dict`."""

    #: Whether numbers that are not finite are written, as ``NaN`` and ``Infinity``; otherwise they are an error.
    _allows_nan: ClassVar[bool] = False

    def to_dict(self) -> dict[str, Any]:
        """Return the result as a JSON object."""
        raise NotImplementedError

    def to_json(self, indent: int | None = None) -> str:
        """Return the object of `to_dict` as JSON text.

        Parameters
        ----------
        indent : int, optional
            Blanks per level, 0 to 16; None for one line.

        Raises
        ------
        OptionError
            If `indent` is no such number. A file is written by ``armgap.files.output.write("x.json", result.to_json())``.
        """
        return json.dumps(self.to_dict(), indent=indentation(indent), allow_nan=self._allows_nan)
