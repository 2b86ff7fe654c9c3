"""Summary of sealed cases: number of questions that each motion settled, and expected against obtained evidence."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.stats import binomtest, spearmanr

from .hypotheses_played import EXCESS, is_followed

#: Probability of a decision from which a plan counts as promising one.
PROMISED = 0.95
#: Probability of the hidden effect from which a diagnosis that names it without look-alikes settles the question.
SETTLED = 0.5


def is_settled(found: tuple[str, float]) -> bool:
    """Return whether a diagnosis names the hidden effect without look-alikes, with a probability of :data:`SETTLED` or more."""
    return found[0] == "named" and found[1] >= SETTLED


def summary(records: list[dict[str, Any]]) -> str:
    """Return counts of settled questions, a paired test of plan against multisine, and rank correlations of evidence, as text."""
    sound = [r for r in records if "error" not in r]
    plan, usual = (np.array([is_settled(r[k]) for r in sound]) for k in ("planned", "multisine"))
    gained, lost = int(np.sum(plan & ~usual)), int(np.sum(usual & ~plan))
    p = binomtest(gained, gained + lost, alternative="greater").pvalue if gained + lost else 1.0
    promised = np.array([(r["promised"] or 0.0) >= PROMISED for r in sound])
    lines = [
        f"{len(sound)} cases, {len(records) - len(sound)} errors",
        f"settled by the plan {plan.sum()}, by the multisine {usual.sum()}; by both {np.sum(plan & usual)}",
        f"of {np.sum(~usual)} that the multisine leaves open the plan settles {gained}; it loses {lost}; p = {p:.2g}",
        f"promised with {PROMISED} or more {promised.sum()}, of these not settled {np.sum(promised & ~plan)}",
    ]
    for key, of in (("evidence", "promised by the question"), ("planned expected", "expected at its size")):
        pairs = [
            (r[key][0] if isinstance(r[key], (list, tuple)) else r[key], r["planned obtained"])
            for r in sound
            if r.get(key) is not None
        ]
        if len(pairs) > 2:
            lines.append(
                f"rank correlation of evidence {of} and obtained: {spearmanr(*np.transpose(pairs)).statistic:.2f}"
            )
    used = [max(r["planned used"][limit] for r in sound) for limit in ("position", "speed", "torque")]
    lines.append("largest part of the limits used by plans: position {:.2f}, speed {:.2f}, torque {:.2f}".format(*used))
    others = [h for r in sound for h in r.get("hypotheses", [])]
    if others:
        used = [max(h[limit] for h in others) for limit in ("position", "speed", "torque")]
        lines.append(
            "played on {} arms with an open hypothesis each: position {:.2f}, speed {:.2f}, torque {:.2f}".format(
                len(others), *used
            )
        )
        over = [h for h in others if not is_followed(h) or h["torque"] > 1.0]
        lines.append(f"over the limits by more than {EXCESS:.0%}, or over the torque limit: {len(over)}")
        lines.append(
            f"largest speed, and largest distance of the ends, of a reference's ends: {max(r['rest'] for r in sound):.1e}"
        )
    return "\n".join(lines)
