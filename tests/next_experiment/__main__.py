"""Plan motions for cases with a hidden effect, play them in MuJoCo, diagnose the logs: ``python -m tests.next_experiment --help``."""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

import armgap

from .cases import CASES, Case, Reference, expected, log_of, multisine, play, poor, write_arm
from .hypotheses_played import is_followed, played, used
from .obtained import obtained
from .sealed import draw
from .summary import is_settled, summary

#: What a first diagnosis may say of the hidden effect for it to be an open question: a wrong `absent` is a fault of the diagnosis, not of a motion.
OPEN = ("undecided", "not excited", "candidate", "look-alike", "named, look-alikes", "named")


def named(diagnosis: armgap.Diagnosis, case: Case) -> tuple[str, float]:
    """Return what a diagnosis says of the hidden effect (named alone, named with look-alikes, candidate, or a status) and its probability.

    Equivalents that no motion can distinguish do not count as look-alikes: each of them may be named, as no experiment decides between them.
    """
    hidden = (case.effect, case.joint)
    for cause in diagnosis.causes:
        alike = [(e.effect, e.joint) for e in cause.equivalents if e.motion_separates]
        same = [(cause.effect, cause.joint), *((e.effect, e.joint) for e in cause.equivalents)]
        if hidden in same and hidden not in alike:
            return ("named, look-alikes" if alike else "named"), cause.probability
    for cause in diagnosis.causes:
        if any((e.effect, e.joint) == hidden for e in cause.equivalents):
            return "look-alike", cause.probability
    if any((c.effect, c.joint) == (case.effect, case.joint) for c in diagnosis.candidates):
        return "candidate", 0.0
    status = [r.status for r in diagnosis.ruled_out if (r.effect, r.joint) == (case.effect, case.joint)]
    return (status[0] if status else "not named"), 0.0


def one(case: Case, seed: int, duration: float, ask: bool) -> dict[str, Any] | None:
    """Diagnose a case from its small first motion, plan a motion, play plan and multisine, diagnose both; return the results as a record.

    Return None where the first log of a sealed case leaves no question about the hidden effect (`OPEN`), or the arm cannot follow its motion.
    """
    with tempfile.TemporaryDirectory() as name:
        arm, arm_file = write_arm(case, seed, Path(name))
        small = play(case, arm, poor(arm, case.arm))
        if case.machine is not None and not is_followed(used(small, case.arm, arm.torque_limit)):
            return None
        first = log_of(small, "first")
        before = armgap.diagnose(first, arm_file)
        said = named(before, case)
        if case.machine is not None and (said[0] not in OPEN or is_settled(said)):
            return None
        began = time.perf_counter()
        wanted = [case.asked] if ask else []
        open_plan = armgap.plan(before, arm_file, questions=wanted, duration=duration, seed=seed)
        seconds = time.perf_counter() - began
        usual = multisine(arm_file, case.arm, duration, seed)
        planned = Reference(open_plan.q_ref, open_plan.dq_ref, open_plan.tau_ff)
        result: dict[str, Any] = {"case": case.name, "seed": seed, "before": named(before, case), "seconds": seconds}
        own = [q for q in open_plan.questions if (q.effect, q.joint) == (case.effect, case.joint)]
        result["promised"] = min((q.settled for q in own), default=None)
        against_none = [q.expected_log_likelihood_ratio for q in own if q.against == "none"]
        result["evidence"] = against_none[0] if against_none else None
        result["all"] = [
            (q.effect, q.joint, q.against, round(q.settled, 3), round(q.expected_log_likelihood_ratio, 1))
            for q in open_plan.questions
        ]
        if case.machine is not None:
            result["hypotheses"] = list(played(case, arm, open_plan, seed))
            ends = np.abs(np.concatenate([planned.dq[[0, -1]], planned.q[[0]] - planned.q[[-1]]]))
            result["rest"] = float(ends.max())
        for key, reference in (("planned", planned), ("multisine", usual)):
            with suppress(ValueError, KeyError):  # effects that the library has no values for, or cannot simulate
                result[f"{key} expected"] = expected(case, before, arm_file, reference, open_plan.threshold)
            trace = play(case, arm, reference)
            result[f"{key} obtained"] = obtained(case, arm_file, arm, trace, before.gap.horizon_s)
            after = armgap.diagnose([first, log_of(trace, key)], arm_file)
            result[key] = named(after, case)
            result[f"{key} used"] = used(trace, case.arm, arm.torque_limit)
            result[f"{key} causes"] = [(c.effect, c.joint) for c in after.causes]
    return result


def sealed(options: argparse.Namespace) -> None:
    """Run cases drawn at random whose first log leaves the effect open, and print how many questions were settled."""
    records: list[dict[str, Any]] = []
    settled, number = 0, options.first
    while len(records) < options.sealed:
        case = draw(options.seed, number)
        number += options.every
        if case is None:
            continue
        try:
            record = one(case, options.seed, options.duration, ask=True)
        except armgap.ArmgapError as error:
            record = {"case": case.name, "error": str(error)}
        settled += record is None
        if record is None:
            continue
        records.append({"number": number - options.every, **record})
        print(json.dumps(records[-1], default=float), flush=True)
        if options.json:
            options.json.write_text(json.dumps(records, indent=1, default=float), encoding="utf-8")
    print(f"{settled} draws were left out, as their first log leaves no question or the arm does not follow it")
    print(summary(records))


def main() -> None:
    """Run the cases and print the table."""
    parser = argparse.ArgumentParser(prog="python -m tests.next_experiment", description=__doc__)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--duration", type=float, default=10.0)
    parser.add_argument("--only", default="", help="part of the names of cases")
    parser.add_argument(
        "--ask",
        action="store_true",
        help="ask for the hidden effect; without it, for what the first diagnosis leaves open",
    )
    parser.add_argument("--sealed", type=int, help="this many cases drawn at random in place of the list")
    parser.add_argument("--first", type=int, default=0, help="number of the first draw")
    parser.add_argument("--every", type=int, default=1, help="take one draw in this many: several runs share the draws")
    parser.add_argument("--json", type=Path, help="write the records")
    options = parser.parse_args()
    if options.sealed:
        sealed(options)
        return
    records = []
    head = (
        "case", "first log", "promised", "at its size", "planned motion", "at its size", "multisine", "position", "speed", "torque", "s",
    )  # fmt: skip
    print("| " + " | ".join(head) + " |")
    print("| " + " | ".join(["---"] * len(head)) + " |")
    for case in CASES:
        if options.only not in case.name:
            continue
        r = one(case, options.seed, options.duration, options.ask)
        assert r is not None
        records.append(r)
        took = r["planned used"]
        shown = [f"{r[k][0]}{f' {r[k][1]:.2f}' if r[k][1] else ''}" for k in ("before", "planned", "multisine")]
        row = (
            case.name, shown[0],
            "not among its questions" if r["promised"] is None else f"{r['promised']:.2f}", f"{r['planned expected'][1]:.2f}",
            shown[1], f"{r['multisine expected'][1]:.2f}", shown[2], *(f"{took[k]:.2f}" for k in ("position", "speed", "torque")),
            f"{r['seconds']:.0f}",
        )  # fmt: skip
        print("| " + " | ".join(row) + " |", flush=True)
    if options.json:
        options.json.write_text(json.dumps(records, indent=1), encoding="utf-8")


main()
