"""Effects of the user's own take part in the ranking, in their own units, and end where they should."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import polars as pl
import pytest

import armgap
from armgap.errors import OptionError

SIZE = 1.3


@pytest.fixture(scope="module")
def fanned(tmp_path_factory: pytest.TempPathFactory) -> tuple[list[Path], armgap.Arm]:
    """Two logs of the sample arm whose first joint drags a fan: a torque no effect of the library is."""
    arm = armgap.Arm.read(Path(armgap.__file__).parent / "demo_case" / "arm.toml")
    folder = tmp_path_factory.mktemp("fanned")
    files = []
    for seed in (1, 2):
        rng = np.random.default_rng(seed)
        t = np.arange(0.0, 6.0, 0.0025)
        tones = rng.uniform(0.4, 2.5, (2, 4)), rng.uniform(0.0, 6.3, (2, 4))
        waves = [np.sin(2 * np.pi * f * t + p) for f, p in zip(tones[0].ravel(), tones[1].ravel(), strict=True)]
        tau = np.stack([10.0 * sum(waves[:4]), 1.5 * sum(waves[4:])], axis=1)
        start = np.zeros(2)
        unit = np.zeros(len(t))
        for _ in range(8):  # the torque along the motion that it causes itself
            pushed = tau + SIZE * np.stack([unit, 0.0 * unit], axis=1)
            run = armgap.simulate(arm, t, pushed, q0=start)
            unit = law(t, run.q, run.dq, tau)
        pl.DataFrame(
            {"t": t, "q1": run.q[:, 0], "q2": run.q[:, 1], "tau1": tau[:, 0], "tau2": tau[:, 1]}
        ).write_parquet(folder / f"fan-{seed}.parquet")
        files.append(folder / f"fan-{seed}.parquet")
    return files, arm


def law(t: np.ndarray, q: np.ndarray, dq: np.ndarray, tau: np.ndarray) -> np.ndarray:
    """A spring that winds up: nothing near zero, then a square."""
    return np.asarray(-np.sign(q[:, 0]) * q[:, 0] ** 2 * np.cos(t))


def test_an_own_effect_is_named_with_its_size(fanned: tuple[list[Path], armgap.Arm]) -> None:
    (train, held), arm = fanned
    own = armgap.CustomEffect("fan", 1, law)
    idle = armgap.CustomEffect("idle", 2, lambda t, q, dq, tau: np.sin(40.0 * t))
    found = armgap.diagnose(train, arm, holdout=held, effects=[idle, own])
    first = found.causes[0]
    assert (first.effect, first.joint) == ("fan", 1)
    assert first.parameters["size"].value == pytest.approx(SIZE, rel=0.05)
    assert first.parameters["size"].unit == "1"
    absent = [r for r in found.ruled_out if r.effect == "idle"]
    assert [r.joint for r in absent] == [2]
    assert "user_effect" not in found.to_json()


def test_what_knows_the_library_only_still_works(fanned: tuple[list[Path], armgap.Arm]) -> None:
    (train, held), arm = fanned
    found = armgap.diagnose(train, arm, holdout=held, effects=[armgap.CustomEffect("fan", 1, law)])
    assert "Fan, joint 1" in found.summary()
    assert "Fan, joint 1" in found._repr_html_()
    assert "fan" in armgap.correct(found, arm).render("json")
    assert len(found.extra["laws"]) == len([c for c in found.causes if c.effect != "fan"])


@pytest.mark.parametrize(
    ("effects", "words"),
    [
        ([armgap.CustomEffect("stribeck", 1, law)], "another effect called 'stribeck'"),
        ([armgap.CustomEffect("Fan", 1, law)], "cannot be called"),
        ([armgap.CustomEffect("fan", 3, law)], "placed on joint 3"),
        ([armgap.CustomEffect("fan", 1, lambda t, q, dq, tau: np.zeros(3))], "shape (3,)"),
        ([armgap.CustomEffect("fan", 1, lambda t, q, dq, tau: 0 * t)], "zero all along"),
        ([armgap.CustomEffect("fan", 1, lambda t, q, dq, tau: np.full(len(t), np.nan))], "is nan"),
        ([armgap.CustomEffect(f"fan{i}", 1, law) for i in range(5)], "5 custom effects"),
    ],
)
def test_unusable_effects_are_refused(
    fanned: tuple[list[Path], armgap.Arm], effects: list[armgap.CustomEffect], words: str
) -> None:
    (train, held), arm = fanned
    with pytest.raises(OptionError) as refusal:
        armgap.diagnose(train, arm, holdout=held, effects=effects)
    assert words in str(refusal.value)
