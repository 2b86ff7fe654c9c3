"""Notebook display of an arm and of a log: a heading, a line of facts and a table, as HTML and as Markdown."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from armgap.log.conversion.unit_names import si
from armgap.log.log import COLUMNS
from armgap.report.conventions import brief
from armgap.report.forms.markdown import escape
from armgap.report.sketch import panel
from armgap.report.words import figure, parameter_text, unit_text, value

if TYPE_CHECKING:
    from armgap.arm.arm import Arm
    from armgap.log.log import Log

__all__ = ["Facts", "arm_facts", "log_facts"]


@dataclass(frozen=True)
class Facts:
    """Contents of a notebook display of an arm or a log; strings other than `sketch` may come from input files.

    Attributes
    ----------
    title, lead : str
        Heading, and a line below it.
    header, rows : sequences of str
        Header and rows of the table.
    notes : sequence of str
        Lines below the table.
    sketch : str
        SVG element drawn by armgap; left out of Markdown.
    """

    title: str
    lead: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    notes: Sequence[str] = ()
    sketch: str = ""

    def html(self) -> str:
        """Return the display as HTML in the notebook's own colours."""
        from jinja2 import Environment

        return Environment(autoescape=True).from_string(_CARD).render(f=self)

    def markdown(self) -> str:
        """Return the display as Markdown."""
        lines = [self.header, ["---"] * len(self.header), *([escape(cell) for cell in row] for row in self.rows)]
        table = "\n".join(f"| {' | '.join(line)} |" for line in lines)
        return "\n\n".join([f"**{escape(self.title)}**", escape(self.lead), table, *map(escape, self.notes)]) + "\n"


_HEADER = ("parameter", "what it is", "value")
_CARD = """\
<div style="max-width: 60em"><p style="font-weight: bold; margin: 0">{{ f.title }}</p><p style="margin: .2em 0">{{ f.lead }}</p>
{% if f.sketch %}<div style="max-width: 20em">{{ f.sketch | safe }}</div>{% endif %}
<table><thead><tr>{% for h in f.header %}<th style="text-align: left">{{ h }}</th>{% endfor %}</tr></thead><tbody>
{% for row in f.rows %}<tr>{% for c in row %}<td style="text-align: left">{{ c }}</td>{% endfor %}</tr>
{% endfor %}</tbody></table>
{% for note in f.notes %}<p style="margin: .2em 0; opacity: .8">{{ note }}</p>
{% endfor %}</div>"""


def arm_facts(arm: Arm) -> Facts:
    """Return the display of an arm: parameters with standard deviations, and conventions."""
    rows = [
        (name, parameter_text(arm.kind, name), value({"value": v, "sigma": s, "unit": unit}))
        for name, unit, v, s in zip(arm.parameter_names, arm.parameter_units, arm.theta, arm.sigma, strict=True)
    ]
    slides = "" if arm.chain is None or arm.rotary else f" ({arm.rotary_joints.count(False)} linear)"
    joints = "1 joint" if arm.n_joints == 1 else f"{arm.n_joints} joints"
    lead = f"{arm.kind}, {joints}{slides}, gravity {figure(arm.gravity)} m/s², sampled every {figure(1e3 * arm.sample_period)} ms"
    units = ["N m" if turns else "N" for turns in arm.rotary_joints]
    limits = [] if arm.torque_limit is None else [f"Limits: {_with_units(arm.torque_limit, units)}."]
    if arm.chain is not None:
        chain = f"Chain: {', '.join(arm.chain.joint_names)}."
        return Facts(arm.name, lead, _HEADER, rows, [chain, *limits, *(f"{note}." for note in arm.notes)])
    notes = [*limits, f"Conventions: {brief(arm.kind)}"]
    return Facts(arm.name, lead, _HEADER, rows, notes, panel(arm.kind))


def _with_units(values: Iterable[float], units: Sequence[str]) -> str:
    """Return figures as text with one unit after all of them, or each with its own unit."""
    if len(set(units)) == 1:
        return f"{', '.join(map(figure, values))} {units[0]}"
    return ", ".join(f"{figure(value)} {unit}" for value, unit in zip(values, units, strict=True))


def log_facts(log: Log) -> Facts:
    """Return the display of a log: columns with their ranges, and findings."""
    rotary = {"rad": True, "mrad": True, "deg": True, "turns": True, "m": False, "mm": False}.get(
        log.units.get("q1", "")
    )
    units = si(rotary)
    rows = [("t", log.columns.get("t", ""), f"{figure(log.t[0])} to {figure(log.t[-1], 5)}", units["t"])]
    for group in COLUMNS:
        values = getattr(log, group)
        for j in range(0 if values is None else values.shape[1]):
            span = f"{figure(values[:, j].min())} to {figure(values[:, j].max())}"
            rows.append(
                (
                    f"{group}{j + 1}",
                    log.columns.get(f"{group}{j + 1}", ""),
                    span,
                    unit_text(units[group.partition("_")[0]]),
                )
            )
    rate = f", {figure(1 / log.sample_period, 4)} Hz" if len(log) > 1 else ""
    lead = f"{len(log)} samples over {figure(log.duration, 4)} s{rate}"
    return Facts(
        log.name, lead, ("column", "in the file", "range", "unit"), rows, [f"{f.message}." for f in log.findings]
    )
