"""Writing of reports to files, in the form given by the file's extension."""

from __future__ import annotations

import json
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from threading import Thread
from typing import TYPE_CHECKING, Any

from armgap.errors import OptionError
from armgap.report.document import Document, diagnosis_document

if TYPE_CHECKING:
    from armgap.diagnosis.result import Diagnosis

__all__ = ["FORMS", "check_report", "diagnosis_report", "prepare_report", "render_report"]

STANDARD_STREAM = "-"


def _html(document: Document, _: dict[str, Any]) -> str:
    from armgap.report.forms.html import page_of

    return page_of(document)


def _markdown(document: Document, _: dict[str, Any]) -> str:
    from armgap.report.forms.markdown import markdown_of

    return markdown_of(document)


def _json(_: Document, data: dict[str, Any]) -> str:
    return json.dumps(data, indent=2, allow_nan=False)


FORMS: dict[str, Callable[[Document, dict[str, Any]], str]] = {
    ".html": _html,
    ".htm": _html,
    ".md": _markdown,
    ".json": _json,
}
"""Functions that return a report as text (HTML, Markdown or JSON), by extension of the file's name."""


def _form(path: str | Path) -> Callable[[Document, dict[str, Any]], str]:
    if str(path) == STANDARD_STREAM:
        return _html
    suffix = Path(path).suffix.lower()
    if suffix not in FORMS:
        what = f"`{suffix}` is no form of a report" if suffix else "the name of a report has no extension"
        raise OptionError(what, remedy="name it .html, .md or .json", file=path)
    return FORMS[suffix]


def check_report(path: str | Path | None) -> None:
    """Raise if the extension of a report's path stands for no form of report.

    Raises
    ------
    OptionError
        If the extension is unknown.
    """
    if path is not None:
        _form(path)


def prepare_report(path: str | Path | None) -> None:
    """Import the modules for a report's charts in a separate thread, in parallel with the computation."""
    if path is not None and _form(path) is _html:
        Thread(target=import_module, args=("bokeh.plotting",), daemon=True).start()


def render_report(document: Document, data: dict[str, Any], path: str | Path) -> str:
    """Return a report in the form that a file name asks for.

    Parameters
    ----------
    document : Document
        Contents of the report.
    data : dict
        The result as a JSON object, for the JSON form.
    path : path-like
        Name of the file, whose extension decides; ``-`` is HTML.

    Raises
    ------
    OptionError
        If the extension is unknown.
    """
    return _form(path)(document, data)


def diagnosis_report(diagnosis: Diagnosis, path: str | Path) -> str:
    """Return the report of a diagnosis in the form that a file name asks for; see `render_report`."""
    return render_report(diagnosis_document(diagnosis), diagnosis.to_dict(), path)
