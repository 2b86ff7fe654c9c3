"""HTML page of a report: one file that loads nothing, with every string of the input escaped."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from importlib import resources
from typing import TYPE_CHECKING, Any

from armgap._renamed import old_names
from armgap.report.words import SummaryAnswer

__all__ = ["Bar", "Cell", "Drawing", "HeatMap", "IntervalLine", "Section", "Table", "Tile", "render"]

if not TYPE_CHECKING:
    __getattr__ = old_names(__name__)


@dataclass(frozen=True)
class Bar:
    """Table cell that holds a bar: a share from 0 to 1, its text and its colour."""

    share: float
    text: str
    colour: str


@dataclass(frozen=True)
class IntervalLine:
    """Table cell that holds dots on a line from -1 to 1 around a shaded middle.

    Attributes
    ----------
    dots : sequence of (position, colour)
        Positions from -1 to 1.
    middle : float
        Half width of the shaded middle.
    text : str
        The positions in words, for a reader without the picture.
    """

    dots: Sequence[tuple[float, str]]
    middle: float
    text: str


Cell = str | Bar | IntervalLine


@dataclass(frozen=True)
class Table:
    """A table of cells; with a `fold` text it is initially folded under the text."""

    header: Sequence[str]
    rows: Sequence[Sequence[Cell]]
    fold: str = ""


@dataclass(frozen=True)
class Drawing:
    """A chart (bokeh model) with a caption in the page's own text; in forms without charts, a table with the same contents."""

    caption: str
    chart: Any
    table: Table | None = None


@dataclass(frozen=True)
class Tile:
    """One tile of a heat map.

    Attributes
    ----------
    text : str
        Value of the tile.
    depth : float
        Darkness of the tile, from 0 to 1.
    tip : str
        Tooltip with the tile's meaning.
    marked : bool
        Whether the tile is outlined.
    low, high : str
        Limits of the tile's range, in the unit of its row; empty without limits.
    """

    text: str
    depth: float
    tip: str = ""
    marked: bool = False
    low: str = ""
    high: str = ""


@dataclass(frozen=True)
class HeatMap:
    """Heat map in rows of tiles, each row with its label."""

    caption: str
    rows: Sequence[tuple[str, Sequence[Tile]]]


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
        Charts: bokeh models, or `Drawing`.
    heats : sequence of HeatMap
        Heat maps next to the charts.
    tables : sequence of Table or (header, rows)
        Tables.
    notes : sequence of str
        Paragraphs after the pictures.
    columns : int
        Number of charts side by side on a wide page.
    sketch : str
        Drawing made by armgap, as an SVG element; never a string of the input, because it is not escaped.
    points : sequence of str
        Entries of a list, shown next to the drawing if there is one.
    name : str
        Name of the section in links, such as ``"conventions"`` in ``#conventions``; by default its number.
    """

    title: str
    text: Sequence[str] = ()
    figures: Sequence[Any] = ()
    heats: Sequence[HeatMap] = ()
    tables: Sequence[Table | tuple[Sequence[str], Sequence[Sequence[Cell]]]] = ()
    notes: Sequence[str] = ()
    columns: int = 1
    sketch: str = ""
    points: Sequence[str] = ()
    name: str = ""


@dataclass(frozen=True)
class _Part:
    """Section of a page with its charts converted to HTML."""

    section: Section
    charts: Sequence[tuple[str, str]]
    tables: Sequence[Table]
    anchor: str = ""


def render(
    title: str,
    lead: str,
    answers: Sequence[SummaryAnswer],
    sections: Sequence[Section],
    *,
    brief: str = "",
    before: Section | None = None,
) -> str:
    """Return a page as HTML.

    Parameters
    ----------
    title, lead : str
        Heading and the sentence below it.
    answers : sequence of SummaryAnswer
        Answers shown on the first screen.
    sections : sequence of Section
        Sections after the answers; pictures of the first section belong to the first screen.
    brief : str
        The arm's conventions in one line, with a link to the section named ``conventions``.
    before : Section, optional
        Section before the answers, without charts.
    """
    drawings = [[_drawing(f) for f in section.figures] for section in sections]
    script, library, divs = _embedded([d.chart for several in drawings for d in several])
    remaining = iter(divs)
    parts = [
        _Part(s, [(d.caption, next(remaining)) for d in several], [_table(t) for t in s.tables], s.name or f"part-{i}")
        for i, (s, several) in enumerate(zip(sections, drawings, strict=True), start=1)
    ]
    head = None if before is None else _Part(before, (), [_table(t) for t in before.tables], before.name or "before")
    page = {"title": title, "lead": lead, "brief": brief, "answers": answers, "parts": parts, "head": head}
    return str(_template().render(**page, script=script, library=library))


def _drawing(figure: Any) -> Drawing:
    return figure if isinstance(figure, Drawing) else Drawing("", figure)


def _table(table: Table | tuple[Sequence[str], Sequence[Sequence[Cell]]]) -> Table:
    return table if isinstance(table, Table) else Table(*table)


def _embedded(charts: Sequence[Any]) -> tuple[str, str, Sequence[str]]:
    """Return charts as JavaScript of the charts, bokeh's library, and HTML element of each chart; empty strings without charts."""
    if not charts:
        return "", "", ()
    from bokeh.document import Document
    from bokeh.embed import components
    from bokeh.resources import Resources

    class Checked(Document):  # type: ignore[misc]
        def validate(self) -> None:
            """Skip bokeh's validation of a chart, an eighth of the report's time; tests validate instead."""

    page = Checked()
    with page.models.freeze():  # bokeh collects the models of the page once, not once per chart
        for chart in charts:
            page.add_root(chart)
    script, divs = components(tuple(charts))
    return script, Resources(mode="inline", components=["bokeh"]).render_js(), divs


def _template() -> Any:
    from jinja2 import DictLoader, Environment, StrictUndefined

    folder = resources.files("armgap.report").joinpath("templates")
    names = ("page.html", "parts.html", "page.css", "page.js")
    files = {name: folder.joinpath(name).read_text(encoding="utf-8") for name in names}
    environment = Environment(
        autoescape=True, loader=DictLoader(files), undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    environment.filters["code"] = _code
    return environment.get_template("page.html")


def _code(text: str) -> Any:
    """Return a text as escaped HTML, with its words between backticks as code elements."""
    from markupsafe import Markup, escape

    parts = text.split("`")
    if len(parts) % 2 == 0:
        return escape(text)
    return Markup("").join(Markup("<code>{}</code>").format(p) if i % 2 else escape(p) for i, p in enumerate(parts))
