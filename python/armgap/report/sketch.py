"""Sketch of an arm's conventions as SVG: zero, positive direction, elbow angle, sign of the torque, gravity.

Lines and texts take their colour from the page (``currentColor`` and the variables ``--ink`` and ``--soft``), so that one drawing is readable
on light and dark pages; the file of `sheet` contains the colours of both. Angles count from hanging down, counter-clockwise.
"""

from __future__ import annotations

from collections.abc import Callable
from math import cos, radians, sin

__all__ = ["KINDS", "panel", "sheet"]

#: Width and height of the sketch of one kind of arm, and height of its title [px].
WIDTH, HEIGHT, TITLE = 300, 220, 26
Point = tuple[float, float]

_STYLE = (
    "svg{color:#1c2126;--soft:#55606b;--ground:#ffffff}"
    "@media(prefers-color-scheme:dark){svg{color:#e8ebee;--soft:#a9b3bd;--ground:#14181c}}"
)
_SOFT = "style='stroke:var(--soft,currentColor)'"
_NAMES = {
    "axis": "A carriage on an inclined rail: position from a zero mark uphill, force in the same direction, gravity down",
    "pendulum": "A pendulum: angle from hanging straight down, torque in the direction of greater angle, gravity down",
    "two-link": (
        "Two links: q1 from hanging straight down, q2 from the extension of link 1, torques in the direction of greater angles, gravity down"
    ),
}


def panel(kind: str) -> str:
    """Return the sketch of one kind of arm as an SVG element to be put into a page.

    Parameters
    ----------
    kind : {"axis", "pendulum", "two-link"}
        Kind of arm.
    """
    return (
        f"<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 {WIDTH} {HEIGHT}' role='img' aria-label='{_NAMES[kind]}' "
        f"font-family='system-ui,sans-serif' font-size='13' fill='none' stroke-linecap='round'>{KINDS[kind]()}</svg>"
    )


def sheet() -> str:
    """Return the sketches of all kinds side by side as an SVG file, for documents."""
    width, height = WIDTH * len(KINDS), HEIGHT + TITLE
    panels = [
        f"<g transform='translate({i * WIDTH} {TITLE})'>{_text((12, -6), kind, weight=600)}{draw()}</g>"
        for i, (kind, draw) in enumerate(KINDS.items())
    ]
    return (
        f"<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 {width} {height}' width='{width}' height='{height}' role='img' "
        f"font-family='system-ui,sans-serif' font-size='13' fill='none' stroke-linecap='round'>"
        f"<title>{'. '.join(_NAMES[kind] for kind in KINDS)}.</title><style>{_STYLE}</style>"
        f"<rect width='{width}' height='{height}' rx='6' style='fill:var(--ground)'/>{''.join(panels)}</svg>\n"
    )


def _axis() -> str:
    """Return the sketch of a linear axis: a carriage on a rail that climbs to the right."""
    start, slope = (30.0, 165.0), radians(90 + 18)

    def along(distance: float, up: float = 0.0) -> Point:
        return _away(_away(start, slope, distance), slope + radians(90), up)

    at, zero = 135.0, 40.0
    corners = [along(at - 24, 3), along(at + 24, 3), along(at + 24, 31), along(at - 24, 31)]
    return "".join(
        [
            _line(along(0), along(245), width=3),
            _dashed(along(zero, -26), along(zero, 30)),
            _text(along(zero - 14, -44), "q1 = 0"),
            _polygon(corners),
            _arrow(along(zero, -12), along(at, -12), slope),
            _text(along(at + 12, -22), "q1 > 0"),
            _arrow(along(at + 24, 17), along(at + 76, 17), slope, width=3),
            _text(along(at + 36, 32), "tau1 > 0"),
            _gravity((40, 30)),
        ]
    )


def _pendulum() -> str:
    """Return the sketch of a pendulum: one link turned by 40 degrees."""
    base, q1 = (150.0, 62.0), radians(40)
    end = _away(base, q1, 120)
    return "".join(
        [
            _dashed(base, (base[0], 205)),
            _text((base[0] - 54, 200), "q1 = 0"),
            _base(base),
            _line(base, end, width=5),
            f"<circle cx='{end[0]:.1f}' cy='{end[1]:.1f}' r='11' fill='currentColor'/>",
            _turn(base, 78, 0, q1),
            _text(_away(base, q1 / 2, 94), "q1", centred=True),
            _torque(base, "tau1 > 0"),
            _gravity((40, 30)),
        ]
    )


def _two_link() -> str:
    """Return the sketch of a two-link arm: link 1 turned by 32 degrees, link 2 by 46 degrees more."""
    base, q1, q2 = (120.0, 48.0), radians(32), radians(46)
    elbow = _away(base, q1, 92)
    end = _away(elbow, q1 + q2, 84)
    return "".join(
        [
            _dashed(base, (base[0], 205)),
            _text((base[0] - 54, 200), "q1 = 0"),
            _dashed(elbow, _away(elbow, q1, 78)),
            _text(_away(elbow, q1, 80), "q2 = 0"),
            _base(base),
            _line(base, elbow, width=5),
            _line(elbow, end, width=5),
            f"<circle cx='{elbow[0]:.1f}' cy='{elbow[1]:.1f}' r='7' style='fill:var(--ground)' stroke='currentColor' stroke-width='2'/>",
            _turn(base, 60, 0, q1),
            _text(_away(base, q1 / 2, 74), "q1", centred=True),
            _turn(elbow, 50, q1, q1 + q2),
            _text(_away(elbow, q1 + q2 / 2, 66), "q2", centred=True),
            _torque(base, "tau1 > 0"),
            _torque(elbow, "tau2 > 0", 95, 195),
            _gravity((30, 30)),
        ]
    )


KINDS: dict[str, Callable[[], str]] = {"axis": _axis, "pendulum": _pendulum, "two-link": _two_link}
"""Functions that return the content of an arm's sketch as SVG, by kind of arm."""


def _away(start: Point, angle: float, distance: float) -> Point:
    """Return the point at a distance [px] from `start`, in a direction given by its angle [rad] from down, counter-clockwise."""
    return start[0] + distance * sin(angle), start[1] + distance * cos(angle)


def _line(a: Point, b: Point, width: float = 1.5) -> str:
    return f"<line x1='{a[0]:.1f}' y1='{a[1]:.1f}' x2='{b[0]:.1f}' y2='{b[1]:.1f}' stroke='currentColor' stroke-width='{width}'/>"


def _dashed(a: Point, b: Point) -> str:
    return f"<line x1='{a[0]:.1f}' y1='{a[1]:.1f}' x2='{b[0]:.1f}' y2='{b[1]:.1f}' {_SOFT} stroke-width='1.2' stroke-dasharray='5 4'/>"


def _polygon(points: list[Point]) -> str:
    text = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
    return f"<polygon points='{text}' style='fill:var(--ground)' stroke='currentColor' stroke-width='2'/>"


def _head(tip: Point, angle: float, size: float) -> str:
    """Return the head of an arrow that points in a direction, as SVG."""
    left, right = (_away(tip, angle + turn, size) for turn in (radians(155), radians(-155)))
    points = " ".join(f"{x:.1f},{y:.1f}" for x, y in (tip, left, right))
    return f"<polygon points='{points}' fill='currentColor'/>"


def _arrow(a: Point, b: Point, angle: float, width: float = 1.5) -> str:
    return _line(a, _away(b, angle, -5), width) + _head(b, angle, 7 + 1.5 * width)


def _turn(centre: Point, radius: float, start: float, end: float, width: float = 1.5) -> str:
    """Return an arc between two directions, counter-clockwise, with an arrow head at its end, as SVG."""
    size = 7 + 1.5 * width
    a, tip = _away(centre, start, radius), _away(centre, end, radius)
    b = _away(centre, end - 0.6 * size / radius, radius)
    large = int(end - start > radians(180))
    arc = f"M{a[0]:.1f} {a[1]:.1f}A{radius} {radius} 0 {large} 0 {b[0]:.1f} {b[1]:.1f}"
    heading = end + radians(90) - 0.5 * size / radius
    return f"<path d='{arc}' stroke='currentColor' stroke-width='{width}'/>" + _head(tip, heading, size)


def _torque(joint: Point, label: str, start: float = 115, end: float = 255) -> str:
    """Return a thick arc around a joint, between two directions in degrees counter-clockwise, with its label, as SVG."""
    arc = _turn(joint, 24, radians(start), radians(end), width=3)
    return arc + _text((joint[0] + 28, joint[1] - 14), label)


def _base(joint: Point) -> str:
    """Return the base that the first joint is fixed to, a hatched plate behind the joint, as SVG."""
    x, y = joint
    hatch = "".join(_line((x - 34 + 9 * i, y - 40), (x - 28 + 9 * i, y - 34), 1.2) for i in range(8))
    legs = _line((x - 9, y - 33), (x, y), 2) + _line((x + 9, y - 33), (x, y), 2)
    circle = f"<circle cx='{x}' cy='{y}' r='7' style='fill:var(--ground)' stroke='currentColor' stroke-width='2'/>"
    return hatch + _line((x - 36, y - 33), (x + 36, y - 33), 2) + legs + circle


def _gravity(top: Point) -> str:
    return _arrow(top, (top[0], top[1] + 52), 0.0, width=2) + _text((top[0] - 14, top[1] + 70), "gravity")


def _text(at: Point, words: str, *, weight: int = 400, centred: bool = False) -> str:
    anchor = " text-anchor='middle' dominant-baseline='middle'" if centred else ""
    escaped = words.replace("<", "&lt;").replace(">", "&gt;")
    return f"<text x='{at[0]:.1f}' y='{at[1]:.1f}' fill='currentColor' font-weight='{weight}'{anchor}>{escaped}</text>"
