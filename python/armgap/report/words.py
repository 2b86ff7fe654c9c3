"""A diagnosis in plain sentences, for terminal, Markdown and report alike."""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from armgap import _native
from armgap._renamed import old_names
from armgap.literals import SERIAL, joint_units
from armgap.remainder import exceeds_floor, leaves_part
from armgap.report.pushes import many_pushes
from armgap.report.symbols import depends_text
from armgap.several_joints import place_text

__all__ = [
    "SummaryAnswer",
    "answers",
    "doubtful",
    "each_joint",
    "error_text",
    "figure",
    "milli_unit",
    "millis",
    "named",
    "parameter_text",
    "percent",
    "sizes",
    "title",
    "unit_text",
    "value",
    "variable_text",
    "verdict",
]

if not TYPE_CHECKING:
    __getattr__ = old_names(__name__)

Data = dict[str, Any]

#: Probability of the first cause below which the named causes are called the best candidates.
DOUBTFUL = 0.5
#: Share of the gap from which a joint other than the first is named in a sentence.
MINOR_JOINT = 0.02
#: Shares beyond which percentages are written with one and with two decimals.
NEARLY, ALMOST = 0.99, 0.995
#: Largest number of joints whose errors a sentence gives; tables and charts have all joints.
MOST_JOINTS = 3
#: Decimal places, and size, beyond which a number is written with an exponent.
MOST_PLACES, MOST = 6, 1e5

_VERDICTS = {
    "none": "The model predicts this arm as well as the logs can tell.",
    "parameters": "The model has the right form but the wrong values.",
    "effect": "The arm does something that its model leaves out.",
    "unexplained": "There is a gap, and no effect in the library explains it.",
    "input": "Logs and arm file contradict each other.",
}
_NO_CAUSE = {
    "none": ("No cause", "Nothing is left to explain."),
    "parameters": ("Wrong values, no missing effect", "The arm file's values, re-estimated, suffice."),
    "unexplained": (
        "None that the library knows",
        "Every known effect was tried and none explains the gap; naming one would mislead.",
    ),
    "input": ("None is named", "While the input contradicts itself, any effect would only imitate the contradiction."),
}
#: First words of the reason of effects that a diagnosis of a serial arm does not test.
_NOT_TESTED = "not tested on serial arms"
_NONE_ALLOWED = (
    "None was allowed",
    "The number of causes was limited to 0, so no effect was tried as one; allow at least one (--max-causes 1).",
)
_ARROW = "\N{NO-BREAK SPACE}→\N{NO-BREAK SPACE}"
_FRICTION = {"viscous": "viscous friction", "coulomb": "Coulomb friction"}
_OF_LINK = {
    "mass": "mass of link",
    **{f"m{axis}": f"first moment along {axis} of link" for axis in "xyz"},
    **{f"i{axis}{axis}": f"moment of inertia about {axis} of link" for axis in "xyz"},
    **{f"i{axes}": f"product of inertia {axes} of link" for axes in ("xy", "xz", "yz")},
    "rotor": "rotor inertia at joint",
}
_INERTIAL = {
    "axis": {"theta1": "moving mass", "theta2": "weight along the axis"},
    "pendulum": {"theta1": "inertia about the joint", "theta2": "gravity torque of the level link"},
    "two-link": {
        "theta1": "inertia about joint 1, elbow at 90°",
        "theta2": "inertial coupling of the links",
        "theta3": "inertia of link 2 about joint 2",
        "theta4": "gravity torque of link 1 and the elbow",
        "theta5": "gravity torque of link 2",
    },
}
#: Titles of causes on serial arms that are no effects of the library, by name of the cause.
_OF_SERIAL_ARMS = {
    "nominal_link": "wrong nominal link",
    "coupled_transmission": "transmission that couples two joints",
    "controller_gain": "wrong proportional gain of the position controller",
    "controller_damping": "wrong derivative gain of the position controller",
    "reference_delay": "late reference",
    "reference_offset": "offset of the reference",
    "viscous_friction": "viscous friction other than the arm file's",
}
_VARIABLES = {"dq": "speed", "reversal": "near a reversal", "q": "position", "tau": "torque", "t": "time"}


@dataclass(frozen=True)
class SummaryAnswer:
    """One question of a summary with its answer.

    Attributes
    ----------
    question : str
        Text of the question.
    headline : str
        The answer in a few words.
    detail : str
        Further information in whole sentences.
    """

    question: str
    headline: str
    detail: str

    @property
    def text(self) -> str:
        """Headline and detail of the answer as running text."""
        return f"{self.headline}. {self.detail}" if self.detail else f"{self.headline}."


@functools.cache
def _titles() -> dict[str, str]:
    return {entry["name"]: entry["title"] for entry in _native.effects()}


def title(effect: str) -> str:
    """Return the title of an effect in words, by its name."""
    return _OF_SERIAL_ARMS.get(effect) or _titles().get(effect, effect.replace("_", " "))


def figure(number: float | None, digits: int = 3) -> str:
    """Return a number as text with a few significant digits; a dash for None."""
    if number is None:
        return "–"
    text = f"{number:.{digits}g}"
    return f"{number:.0f}" if "e+" in text and abs(number) < MOST else text


def percent(share: float) -> str:
    """Return a share as a percentage, with more digits near 100 % and never rounded up to it."""
    places = 0 if share <= NEARLY or share >= 1.0 else 1 if share <= ALMOST else 2
    number = f"{min(100 * share, 99.99):.{places}f}" if places else f"{100 * share:.0f}"
    return f"{'0' if number == '-0' else number}\N{NO-BREAK SPACE}%"


def unit_text(unit: str) -> str:
    """Return a unit for readers: powers raised, empty for ratios."""
    return "" if unit == "1" else unit.replace("^2", "²").replace("^3", "³")


def value(entry: Any, digits: int = 4) -> str:
    """Return a value with its standard deviation, both rounded to the same decimal place, and unit; or a bare number."""
    if not isinstance(entry, dict):
        return "" if entry is None else figure(float(entry), digits)
    if isinstance(entry["value"], list):
        each = zip(entry["value"], entry["sigma"], strict=True)
        numbers = " / ".join(_spread(number, sigma, digits) for number, sigma in each)
    else:
        numbers = _spread(entry["value"], entry["sigma"], digits)
    return f"{numbers} {unit_text(str(entry.get('unit', '')))}".strip()


def _spread(number: float | None, sigma: float | None, digits: int) -> str:
    if number is None or not sigma:
        return figure(number, digits)
    places = 1 - math.floor(math.log10(sigma))
    if not 0 <= places <= MOST_PLACES or abs(number) >= MOST:
        return f"{figure(number, digits)} ± {figure(sigma, 2)}"
    return f"{number:.{places}f} ± {sigma:.{places}f}"


def sizes(parameters: Data) -> str:
    """Return the parameters of an effect in one line of text."""
    return ", ".join(f"{name} {value(p, 3)}" for name, p in parameters.items())


def error_text(number: float) -> str:
    """Return an RMS error as text with two significant digits, zeros included.

    Examples
    --------
    >>> error_text(39.6), error_text(0.00698), error_text(102.0)
    ('40', '0.0070', '102')
    """
    return figure(number) if abs(number) >= 100 or number == 0 else f"{number:#.2g}".rstrip(".")


def milli_unit(units: Sequence[str]) -> str:
    """Return thousandths of the joints' units as text for the heading of a column or an axis.

    Examples
    --------
    >>> milli_unit(["rad", "rad"]), milli_unit(["rad", "m"])
    ('mrad', 'mrad or mm')
    """
    return " or ".join(f"m{unit}" for unit in dict.fromkeys(units))


def millis(values: Sequence[float], units: Sequence[str]) -> str:
    """Return RMS errors per joint as text in thousandths of the unit, or in whole units for large errors, with a unit each if the units differ.

    Examples
    --------
    >>> millis([0.001, 0.002], ["rad", "rad"]), millis([0.001, 0.002], ["rad", "m"])
    ('1.0 and 2.0 mrad', '1.0 mrad and 2.0 mm')
    """
    scale, prefix = (1.0, "") if max(values) >= 1.0 else (1e3, "m")
    alike = len(set(units)) == 1
    numbers = [
        error_text(scale * v) + ("" if alike else f" {prefix}{unit}") for v, unit in zip(values, units, strict=True)
    ]
    text = " and ".join(filter(None, (", ".join(numbers[:-1]), numbers[-1])))
    return f"{text} {prefix}{units[0]}" if alike else text


def each_joint(*models: Sequence[float], units: Sequence[str], joints: Sequence[int] | None = None) -> str:
    r"""Return the errors of each joint from one model to the next as text, in thousandths of the unit, or in whole units for large errors.

    `joints` are the joints of the errors, from 1; by default all joints in order.

    Examples
    --------
    >>> each_joint([0.0076, 0.0396], [3.3e-5, 2.9e-5], units=["rad", "rad"]).split("; ")
    ['Joint 1: 7.6\xa0→\xa00.033\xa0mrad', 'joint 2: 40\xa0→\xa00.029\xa0mrad']
    """
    scale, prefix = (1.0, "") if max(max(values) for values in models) >= 1.0 else (1e3, "m")
    ends = [
        f"{_ARROW.join(error_text(scale * v) for v in errors)}\N{NO-BREAK SPACE}{prefix}{unit}"
        for unit, *errors in zip(units, *models, strict=True)
    ]
    numbers = joints or range(1, len(ends) + 1)
    return (
        ends[0]
        if len(ends) == 1
        else _capital("; ".join(f"joint {j}: {e}" for j, e in zip(numbers, ends, strict=True)))
    )


def parameter_text(kind: str, name: str) -> str:
    """Return the meaning of an arm's parameter in a few words; empty for an unknown parameter."""
    stem, number = name.rstrip("0123456789"), name[len(name.rstrip("0123456789")) :]
    if stem in _FRICTION:
        return f"{_FRICTION[stem]} of joint {number}"
    if kind == SERIAL and stem in _OF_LINK:
        return f"{_OF_LINK[stem]} {number}"
    return _INERTIAL.get(kind, {}).get(name, "")


def named(effect: Data) -> str:
    """Return an effect with its joint, and its log if it belongs to one, as text."""
    place = f"{title(effect['effect'])}, {place_text(effect)}"
    if sides := effect.get("sides"):
        encoder, friction = sides["encoder"], sides["friction"]
        place += f" ({f'encoder and friction at the {encoder}' if encoder == friction else f'encoder at the {encoder}, friction at the {friction}'})"
    return f"{place}, in {effect['log']}" if effect.get("log") else place


def doubtful(data: Data) -> bool:
    """Whether the first cause that a diagnosis names has a probability below `DOUBTFUL`."""
    causes = data.get("causes") or []
    return bool(causes) and causes[0]["probability"] < DOUBTFUL


def none_allowed(data: Data) -> bool:
    """Whether a gap remains for which no cause could be named because the number of causes was limited to zero."""
    return data["verdict"] == "unexplained" and (data.get("options") or {}).get("max_causes") == 0


def verdict(data: Data) -> str:
    """Return the verdict of a diagnosis as a sentence."""
    if data["verdict"] == "input":
        return _contradiction(data)
    if doubtful(data) or leaves_part(data):
        return "The arm does something that its model leaves out, and part of the gap stays unexplained."
    if none_allowed(data):
        return "There is a gap; no cause was allowed, so none is named."
    if data["verdict"] == "none" and exceeds_floor(data, "after"):
        return (
            "The model predicts this arm nearly as well as the logs can tell; what is left is small beside its motion."
        )
    return _VERDICTS.get(data["verdict"], str(data["verdict"]))


def _contradiction(data: Data) -> str:
    """Return a sentence that names the checks that found contradictions, such as "torque sign of joint 1", with their remedies."""
    found = _errors(data)
    if not found:
        return _VERDICTS["input"]
    remedies = dict.fromkeys(text for c in found if (text := c.get("remedy")))
    remedy = f" Remedy: {'; '.join(remedies)}" if remedies else ""
    return f"{_VERDICTS['input'].rstrip('.')}: {', '.join(dict.fromkeys(map(_check_text, found)))}.{remedy}"


def _errors(data: Data) -> list[Data]:
    return [c for c in data.get("checks") or [] if c["severity"] == "error"]


def _check_text(check: Data) -> str:
    """Return name and place of a check of the input as text."""
    name = check["check"].replace("_", " ")
    return name if check.get("joint") is None else f"{name} of joint {check['joint']}"


def answers(data: Data) -> list[SummaryAnswer]:
    """Return the three questions of a diagnosis (where, which, how far) with their answers."""
    first = SummaryAnswer("Where is the gap?", *_where(data))
    if data["verdict"] == "input":
        first = SummaryAnswer("What contradicts what?", *_contradicts(data))
    return [
        first,
        SummaryAnswer("Which effect causes it?", *_which(data)),
        SummaryAnswer("How far does it shrink?", *_how_far(data)),
    ]


def _contradicts(data: Data) -> tuple[str, str]:
    found = _errors(data)
    headline = ", ".join(dict.fromkeys(map(_check_text, found))) or "See the checks of the input"
    return _capital(headline), " ".join(_capital(f"{c['message'].rstrip('.')}.") for c in found)


def _where(data: Data) -> tuple[str, str]:
    places = data.get("where") or []
    if data["verdict"] == "none" or not places:
        return "No part of the motion stands out", ""
    first = places[0]
    ranged = bool(first.get("range"))
    limits = _limits(data, first)
    headline = f"Joint {first['joint']}, {_regime(first)}" + (f": {limits}" if limits else "")
    load = "force" if data["gap"].get("unit") == "m" else "torque"
    text = f"{percent(first['share'])} of what is missing from the model acts on joint {first['joint']}"
    if len(data["gap"]["before"]) == 1:
        at_times = data["causes"] and all(c.get("log") for c in data["causes"])
        text = f"The {load} that is missing from the model acts {'at times' if at_times else 'throughout'}"
    if ranged:
        text += f", and is largest {_inside(first)}"
    others = [f"{percent(p['share'])} on joint {p['joint']}" for p in places[1:] if p["share"] >= MINOR_JOINT]
    text += f"; {', '.join(others)}." if others else "."
    return headline, text if data[
        "verdict"
    ] == "parameters" else f"{text} Missing is what re-estimated values cannot supply."


def _regime(place: Data) -> str:
    """Return the regime of a location in words, to follow the joint's name."""
    if not place.get("range"):
        return "throughout its motion"
    return f"{'in' if place['regime'].startswith('part') else 'at'} {place['regime']}"


def _inside(place: Data) -> str:
    """Return the regime of a location as a detail in words."""
    span = place["range"]
    if span["variable"].startswith("reversal"):
        return str(place["detail"])
    name = variable_text(span["variable"])
    return f"in that {'stretch' if name == 'time' else 'range'} of {name}"


def _limits(data: Data, place: Data) -> str:
    """Return the range of a location's regime with the joint's whole range: ``0.02 to 0.53 of at most 4.1 rad/s``."""
    span = place.get("range")
    if not span or span["variable"].startswith("reversal"):
        return ""
    text = f"{figure(span['from'], 2)} to {figure(span['to'], 2)}"
    for r in data.get("regimes") or []:
        if (r["joint"], r["variable"]) == (place["joint"], span["variable"]):
            low, high = figure(r["edges"][0], 2), figure(r["edges"][-1], 2)
            whole = f"at most {high}" if r["variable"].startswith("abs(") else f"{low} to {high}"
            return f"{text} of {whole} {unit_text(r['unit'])}".strip()
    unit = str(place["detail"]).rpartition(f"{span['to']:.3f}")[2].strip()
    return f"{text} {unit}".strip()


def variable_text(variable: str) -> str:
    """Return the variable of a regime, such as speed or position, in a word."""
    bare = variable.replace("abs(", "").rstrip(")").rstrip("0123456789")
    return _VARIABLES.get(bare, variable)


def _untested(data: Data) -> str:
    """Return a sentence on a serial arm without a named cause, with the effects that its logs are not tested for."""
    ruled_out = data.get("ruled_out") or []
    names = dict.fromkeys(r["effect"] for r in ruled_out if (r.get("why") or "").startswith(_NOT_TESTED))
    tried = "Every effect that is tested on serial arms was tried and none explains the gap"
    return f"{tried}; not tested: {', '.join(map(title, names))}." if names else f"{tried}."


def _which(data: Data) -> tuple[str, str]:
    causes = data.get("causes") or []
    if not causes and none_allowed(data):
        return _NONE_ALLOWED
    if not causes:
        headline, text = _NO_CAUSE.get(data["verdict"], ("No cause was named", ""))
        if data["verdict"] == "unexplained" and (data.get("arm") or {}).get("kind") == SERIAL:
            headline, text = "None that was tested", _untested(data)
        depends = ", ".join(f"{depends_text(d)} (joint {d['joint']})" for d in data.get("unnamed") or [])
        is_listed = depends and data["verdict"] == "unexplained"
        return headline, f"{text} What stays depends on {depends}." if is_listed else text
    headline = _capital(" and ".join(_counted([f"{title(c['effect'])}, {place_text(c)}" for c in causes])))
    others, sentences = many_pushes(causes)
    text = " ".join([*(_about(cause, alone=len(causes) == 1) for cause in others), *sentences])
    if doubtful(data):
        headline += " (doubtful)"
        text += " Best candidates only: what they leave is explained by no effect in the library."
    return headline, text


def _counted(names: list[str]) -> list[str]:
    """Return names in order, each once, with its number of occurrences."""
    times = {name: names.count(name) for name in names}
    return [name if n == 1 else f"{name} ({n} times)" for name, n in times.items()]


def _about(cause: Data, *, alone: bool) -> str:
    """Return sizes, probability and equivalents of one cause as text."""
    lead = "" if alone else f"{named(cause)}: "
    text = _capital(f"{lead}{sizes(cause['parameters'])}; probability {cause['probability']:.2f}")
    others = cause.get("equivalents") or []
    if others:
        text += f". These logs do not tell it from {' or '.join(named(e) for e in others)}"
    return text + "."


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]


def _missed_most(errors: Sequence[float]) -> list[int]:
    """Return the joints, from 1, whose errors a sentence lists: all if there are few, else those with the largest errors."""
    numbers = range(1, len(errors) + 1)
    if len(errors) <= MOST_JOINTS:
        return list(numbers)
    return sorted(sorted(numbers, key=lambda j: -errors[j - 1])[:MOST_JOINTS])


def _how_far(data: Data) -> tuple[str, str]:
    gap = data["gap"]
    joints = _missed_most(gap["before"])
    units = [joint_units(data)[j - 1] for j in joints]
    few = len(joints) < len(gap["before"])
    before, refit, after, floor = ([gap[key][j - 1] for j in joints] for key in ("before", "refit", "after", "floor"))
    if data["verdict"] == "input":
        headline, errors = "With the remedy applied", each_joint(before, refit, units=units, joints=joints)
    elif data["verdict"] == "none":
        headline, errors = "Nothing to shrink", each_joint(after, units=units, joints=joints)
    elif data["verdict"] == "unexplained" and (
        gap.get("training") or not exceeds_floor(data, "before") or gap["closed"] <= 0
    ):
        headline = "The held-out motion shows none; the training logs do" if gap.get("training") else "It stays"
        errors = each_joint(after, units=units, joints=joints)
    elif data["verdict"] == "unexplained":
        headline = f"By {percent(gap['closed'])} with other values of the arm; the rest stays"
        errors = each_joint(before, after, units=units, joints=joints)
    else:
        headline, errors = _share_closed(data), each_joint(before, after, units=units, joints=joints)
    detail = (
        f"{errors}: RMS error of predictions over {gap['horizon_s']:g} s on held-out motion"
        f"{', of the joints that the arm file misses most' if few else ''}. Re-estimating the arm file's own values alone "
        f"leaves {millis(refit, units)}; {_perfect(data, floor, units)}"
    )
    if data["verdict"] not in ("none", "input") and exceeds_floor(data, "before"):
        low, high = (percent(max(share, -1.0)) for share in gap["closed_ci"])
        below = "below " if gap["closed_ci"][0] < -1.0 else ""
        detail += f" 95\N{NO-BREAK SPACE}% interval of the share closed: {below}{low} to {high}."
    return headline, detail


def _perfect(data: Data, floor: Sequence[float], units: Sequence[str]) -> str:
    """Return what a perfect model would miss by, as the end of a sentence; filtered positions do not show their noise."""
    if any(check["check"] == "filtered_positions" for check in data.get("checks") or []):
        return "what a perfect model would miss by is not known, as the positions are filtered."
    return f"a perfect model would miss by {millis(floor, units)}, from noise and the measured starts."


def _share_closed(data: Data) -> str:
    """Return the share of the gap that causes or re-estimated values close, as a headline; in words where there is none."""
    if not exceeds_floor(data, "before"):
        return "The held-out motion shows no gap to close"
    if data["gap"]["closed"] < 0:
        return f"{'The causes' if data.get('causes') else 'Other values'} do not shrink the gap of the held-out motion"
    return f"By {percent(data['gap']['closed'])}"
