"""Random choices of training logs, holdout and horizon, their answers, and the count of what is named."""

from __future__ import annotations

import json
import random
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

#: Horizons that are drawn from [s].
HORIZONS = (0.1, 0.15, 0.2, 0.25, 0.3)
#: Largest number of training logs and of holdout logs that are drawn.
MOST_TRAINING, MOST_HOLDOUT = 5, 3


def draw(seed: int, number: int, count: int) -> tuple[list[int], list[int], float]:
    """Return the indices of training logs and holdout, of `count` logs, and the horizon [s] of one draw."""
    generator = random.Random(f"{seed} {number}")
    order = list(range(count))
    generator.shuffle(order)
    training = generator.randint(1, min(MOST_TRAINING, count - 1))
    holdout = generator.randint(1, min(MOST_HOLDOUT, count - training))
    return sorted(order[:training]), sorted(order[training : training + holdout]), generator.choice(HORIZONS)


def answer(seed: int, number: int, *, logs: Sequence[Path], arm_file: Path) -> dict[str, Any]:
    """Diagnose the arm from the logs of one draw."""
    import armgap

    training, holdout, horizon = draw(seed, number, len(logs))
    paths = [[str(logs[i]) for i in part] for part in (training, holdout)]
    found = armgap.diagnose(paths[0], armgap.Arm.read(arm_file), holdout=paths[1], horizon=horizon).to_dict()
    causes = [{key: cause[key] for key in ("effect", "joint", "probability")} for cause in found["causes"]]
    return {
        "number": number, "training": training, "holdout": holdout, "horizon": horizon,
        "verdict": found["verdict"], "gap": found["gap"], "causes": causes,
    }  # fmt: skip


def line(record: dict[str, Any]) -> str:
    """Return one answer as a line of text: logs, horizon, verdict, gap [mrad or mm] and causes with their probability."""
    if "causes" not in record:
        return json.dumps(record)
    after = " / ".join(f"{1e3 * x:.1f}" for x in record["gap"]["after"])
    causes = ", ".join(f"{c['effect']} {c['joint']} {c['probability']:.2f}" for c in record["causes"])
    logs = f"{record['training']} -> {record['holdout']}"
    return f"{record['number']:3d} {logs:32s} {record['horizon']:.2f} s {record['verdict']:12s} {after:14s} {causes}"


def named(records: Sequence[dict[str, Any]]) -> list[str]:
    """Return how often each effect is named, and how often with a probability of a half or more."""
    answered = [record for record in records if "causes" in record]
    all_names: Counter[str] = Counter()
    sure: Counter[str] = Counter()
    for record in answered:
        all_names.update({f"{c['effect']} {c['joint']}" for c in record["causes"]})
        sure.update({f"{c['effect']} {c['joint']}" for c in record["causes"] if c["probability"] >= 0.5})
    rows = [f"{name}: {count}, with 0.5 or more {sure[name]}" for name, count in all_names.most_common()]
    return [f"{len(answered)} of {len(records)} draws answered; named", *rows]
