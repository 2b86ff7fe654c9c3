"""The page around sections: one file, offline, every string of the input escaped."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from importlib import resources
from typing import Any

__all__ = ["Section", "render"]


@dataclass(frozen=True)
class Section:
    """One part of a report.

    Attributes
    ----------
    title : str
        Heading.
    text : sequence of str
        Paragraphs.
    figures : sequence
        Charts (bokeh models).
    tables : sequence of (header, rows)
        Tables of strings.
    heat : sequence of (label, cells)
        Rows of a map; each cell is a text and a depth from 0 to 1.
    heat_title : str
        Caption of the map.
    notes : sequence of str
        Paragraphs after the pictures.
    fold : bool
        Whether the section starts closed.
    """

    title: str
    text: Sequence[str] = ()
    figures: Sequence[Any] = ()
    tables: Sequence[tuple[Sequence[str], Sequence[Sequence[str]]]] = ()
    heat: Sequence[tuple[str, Sequence[tuple[str, float]]]] = ()
    heat_title: str = ""
    notes: Sequence[str] = ()
    fold: bool = False


@dataclass(frozen=True)
class _Drawn:
    section: Section
    divs: list[str] = field(default_factory=list)


def render(title: str, lead: str, answers: Sequence[tuple[str, str]], sections: Sequence[Section]) -> str:
    """Return a page as HTML.

    Parameters
    ----------
    title, lead : str
        Heading and the sentence below it.
    answers : sequence of (question, answer)
        The first screen.
    sections : sequence of Section
        What follows; the first one's pictures belong to the first screen.
    """
    from bokeh.embed import components
    from bokeh.resources import Resources
    from jinja2 import Environment, select_autoescape

    figures = [f for section in sections for f in section.figures]
    script, divs = components(figures) if figures else ("", ())
    remaining = list(divs)
    drawn = []
    for section in sections:
        mine = [remaining.pop(0) for _ in section.figures]
        drawn.append(_Drawn(section, mine))
    library = Resources(mode="inline", components=["bokeh"]).render_js() if figures else ""
    template = resources.files("armgap.report").joinpath("templates/page.html").read_text(encoding="utf-8")
    environment = Environment(autoescape=select_autoescape(default=True, default_for_string=True))
    return environment.from_string(template).render(
        title=title, lead=lead, answers=answers, drawn=drawn, script=script, library=library
    )
