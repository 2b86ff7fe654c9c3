"""Cases of the trial: an arm, logs of its motion, and a key that says what is hidden, all drawn from a seed and a number."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

import armgap
import armgap.arm.controller
from armgap.arm.serial.chain import SerialChain
from armgap.literals import SERIAL

from .arms import SerialRobot, draw_robot, perturbed
from .effects import BESIDE, EFFECTS, OUTSIDE, Clutter, Effect, Null, Use
from .motion import (
    COMMANDED_PERIODS,
    PERIODS,
    SERVOS,
    Controller,
    Run,
    coloured,
    draw_controller,
    draw_reference,
    draw_torque,
    simulate,
    use_of,
)
from .servo import COMMANDED
from .visibility import visibility

Array = NDArray[np.float64]

#: Standard deviations in the arm file by degree of trust: of inertial values, as shares of mass times powers of the link's length; of rotor
#: inertias and of friction, as shares of their values.
TRUST = {"published": (0.1, 0.3, 0.5), "trusted": (0.01, 0.05, 0.5)}
#: Largest difference of the true from the nominal values, in the arm file's standard deviations.
OFF = 0.8
#: Smallest RMS change of a joint's torque that a hidden effect must make, as a share of the joint's RMS torque.
LEAST = 0.03
#: Standard deviations of torque disturbances that the log does not show, as shares of the joint's RMS torque.
NOISE = (0.0, 0.01, 0.02)
#: Largest number of draws for a case, of which the first with a usable motion and a visible effect of sufficient size is taken.
_DRAWS = 80
_KINDS = {effect.name: effect for effect in OUTSIDE} | COMMANDED
#: Effects that have to be visible, those of the arm and not of its position controller; in clutter the main effect alone has no logs to tell.
_OF_ARM = {*EFFECTS.values(), *OUTSIDE}
_LOGS = ("train-1", "train-2", "holdout-1")
_DURATION_S = 12.0
#: Numbers of the first case without an effect, with an effect that the library does not have, and with clutter.
NULLS, OUTSIDES, CLUTTERS = 1_000_000, 2_000_000, 3_000_000
#: Number of effects beside the main one in clutter, and their aimed changes of a joint's torque as shares of that of the main effect.
_BESIDE, _SHARES = (2, 4), (0.1, 1 / 3)


@dataclass(frozen=True)
class Case:
    """One case of the trial.

    Attributes
    ----------
    arm : armgap.Arm
        Nominal model.
    training, holdout : list of armgap.Log
        Training logs and holdout logs.
    key : dict
        What is hidden: ``effect``, ``joint`` (from 1; None for the whole arm), ``values``, ``outside`` (whether armgap's library lacks the
        effect), ``change`` (RMS change of the joint's torque by the effect, as a share of that torque), ``above_floor`` and ``moved`` (see
        `visibility.Visibility`; of effects of the arm); and how the case was made.
    """

    arm: armgap.Arm
    training: list[armgap.Log]
    holdout: list[armgap.Log]
    key: dict[str, Any]


def effect_of(seed: int, number: int, *, commanded: bool = False) -> str:
    """Return the name of a case's effect: among as many consecutive cases as there are effects, each has another, in an order by the seed."""
    if number >= CLUTTERS:
        effects, number = [name for name, effect in EFFECTS.items() if not effect.outside], number - CLUTTERS
    elif number >= OUTSIDES:
        effects, number = [effect.name for effect in OUTSIDE], number - OUTSIDES
    else:
        effects = list(COMMANDED if commanded else EFFECTS)
    turn, place = divmod(number, len(effects))
    return effects[int(np.random.default_rng([seed, turn, 7]).permutation(len(effects))[place])]


def sigma_of(robot: SerialRobot, trust: str) -> Array:
    """Return the standard deviations of the arm file's values for a degree of trust, shape (13 n,)."""
    inertial, rotor, friction = TRUST[trust]
    powers = np.array([0, 1, 1, 1, 2, 2, 2, 2, 2, 2])
    links = [inertial * link.mass * size**powers for link, size in zip(robot.links, robot.lengths, strict=True)]
    return np.concatenate([*links, rotor * robot.rotor, friction * robot.viscous, friction * robot.coulomb])


def arm_of(robot: SerialRobot, period: float, trust: str, by: Controller | None = None) -> armgap.Arm:
    """Return a simulated arm as an `armgap.Arm`, with the position controller `by` where the logs hold references."""
    chain = SerialChain(
        tuple(f"joint{j + 1}" for j in range(robot.n)), tuple(f"link{j + 1}" for j in range(robot.n)),
        robot.kinds, robot.rotation, robot.translation, robot.axis, robot.gravity, robot.lower, robot.upper,
    )  # fmt: skip
    gravity = float(np.linalg.norm(robot.gravity))
    return armgap.Arm(
        robot.name,
        SERIAL,
        gravity,
        period,
        robot.theta,
        sigma_of(robot, trust),
        robot.counts,
        robot.effort,
        chain=chain,
        controller=None if by is None else armgap.arm.controller.Controller(by.kp, by.kd),
    )


def make_case(
    seed: int,
    number: int,
    effect: str | type[Effect] | None = None,
    *,
    family: str | None = None,
    joints: int | None = None,
    duration: float = _DURATION_S,
    commanded: bool = False,
) -> Case:
    """Make a case.

    Parameters
    ----------
    seed, number : int
        Seed of the trial and number of the case, which decide everything; null cases have numbers from `NULLS`.
    effect : str or type of Effect, optional
        The hidden effect or its name, ``"null"`` for none; by default the effect of the case's number.
    family : str, optional
        Family of the arm; drawn by default.
    joints : int, optional
        Number of joints, at most that of the family; drawn by default.
    duration : float, default 12
        Duration of each log [s].
    commanded : bool, default False
        Whether the arm's servos follow references, and the logs hold the references in place of torques.

    Raises
    ------
    RuntimeError
        If no draw has a usable motion and a visible effect of sufficient size.
    """
    name = effect or ("null" if NULLS <= number < OUTSIDES else effect_of(seed, number, commanded=commanded))
    kind = _KINDS.get(name, Null) if isinstance(name, str) else name
    for draw in range(_DRAWS):
        rng = np.random.default_rng([seed, number, draw])
        case = _draw(rng, kind, family, joints, duration, commanded=commanded, clutter=number >= CLUTTERS)
        if case is not None:
            case.key.update(seed=seed, number=number, draw=draw)
            return case
    raise RuntimeError(f"case {number} of seed {seed}: no draw of {kind.name} makes a difference")


def _draw(
    rng: np.random.Generator,
    kind: type[Effect],
    family: str | None,
    joints: int | None,
    duration: float,
    *,
    commanded: bool,
    clutter: bool,
) -> Case | None:
    robot = draw_robot(rng, family, joints)
    trust = "trusted" if kind.trusted_inertia else "published"
    period = float(rng.choice(COMMANDED_PERIODS if commanded else PERIODS))
    noise = float(rng.choice(NOISE))
    samples = round(duration / period)
    clean = perturbed(robot, rng, *(OFF * share for share in TRUST[trust]))
    references = [draw_reference(robot, samples, period, rng) for _ in _LOGS]
    controllers = ["pd", "computed_torque", "excited", *(["open"] if robot.upside_down else [])]
    controllers = list(SERVOS) if commanded else controllers
    controlled = str(rng.choice(controllers))
    following = draw_controller(controlled if controlled != "open" else "pd", robot, references[0], period, rng)
    times = rng.uniform(0.05, 0.3, robot.n)
    seeds = rng.integers(0, 2**31, len(_LOGS))
    joint = int(rng.integers(robot.n)) if kind.per_joint else None
    share = float(np.exp(rng.uniform(np.log(0.05), np.log(0.3))))

    quiet = np.zeros((samples, robot.n))
    pd = replace(following, kind="pd") if controlled == "excited" else following
    first = simulate(clean, robot, Null(None), references[0], pd, quiet, period)
    if not first.sane(robot, references[0], follows=True):
        return None
    use = use_of(first)
    hidden = kind.draw(clean, joint, share, use, rng)
    if clutter:
        hidden = _cluttered(hidden, clean, share, use, rng)
    robot, bare = hidden.without(robot), hidden.without(clean)
    if bare is not clean:
        clean = bare
        first = simulate(clean, robot, Null(None), references[0], pd, quiet, period)
    truth = hidden.changed(clean)
    there = simulate(truth, robot, hidden, references[0], pd, quiet, period)
    change = _change(first, there)
    at = hidden.joint if hidden.joint is not None else int(np.argmax(change))
    if not isinstance(hidden, Null) and not (np.isfinite(change[at]) and change[at] >= LEAST):
        return None

    runs, plain = [], []
    for reference, own in zip(references, seeds, strict=True):
        random = np.random.default_rng(own)
        disturbance = coloured(noise * use.torque, times, samples, period, random)
        by = following
        if controlled == "excited":
            size = random.uniform(0.1, 0.3) * use.torque
            by = replace(following, played=draw_torque(size, samples, period, random))
        elif controlled == "open":
            before = simulate(clean, robot, Null(None), reference, following, quiet, period)
            by = replace(following, kind="open", played=before.tau)
        run = simulate(truth, robot, hidden, reference, by, disturbance, period)
        if not run.sane(robot, reference, follows=controlled in ("pd", "computed_torque", *SERVOS)):
            return None
        runs.append(run)
        if not isinstance(hidden, Null):
            plain.append(simulate(clean, robot, Null(None), reference, by, disturbance, period))
    arm = arm_of(robot, period, trust, following if commanded else None)
    logs = [
        armgap.Log.from_arrays(
            r.t, r.q, None if commanded else r.tau, q_ref=reference.q if commanded else None, name=name, arm=arm
        )
        for name, r, reference in zip(_LOGS, runs, references, strict=True)
    ]
    main = hidden.main if isinstance(hidden, Clutter) else hidden
    beside = hidden.beside if isinstance(hidden, Clutter) else []
    key = {
        "effect": main.name, "joint": None if hidden.joint is None else hidden.joint + 1, "values": main.values,
        "outside": main.outside, "beside": [_told(effect) for effect in beside],
        "change": float(change[at]), "changes": change.tolist(), "family": robot.name, "joints": robot.n,
        "kinds": "".join(kind[0].upper() for kind in robot.kinds), "period": period, "noise": noise, "controller": controlled,
        "theta": truth.theta.tolist(),
    }  # fmt: skip
    if plain and kind in _OF_ARM and not clutter:
        seen = visibility(robot, sigma_of(robot, trust), plain, runs)
        if not seen.visible:
            return None
        key |= asdict(seen)
    return Case(arm, logs[:-1], logs[-1:], key)


def _told(effect: Effect) -> dict[str, Any]:
    """Return the entries of a case's key about an effect beside the main one."""
    return {"effect": effect.name, "joint": (effect.joint or 0) + 1, "values": effect.values, "outside": effect.outside}


def _cluttered(main: Effect, robot: SerialRobot, share: float, use: Use, rng: np.random.Generator) -> Clutter:
    """Return clutter around a main effect: effects of other kinds, on joints drawn at random."""
    clutter = Clutter(main.joint, main)
    kinds = [kind for kind in BESIDE if not main.name.startswith(kind.name)]
    for place in rng.permutation(len(kinds))[: int(rng.integers(_BESIDE[0], _BESIDE[1] + 1))]:
        size = share * float(np.exp(rng.uniform(*np.log(_SHARES))))
        clutter.beside.append(kinds[int(place)].draw(robot, int(rng.integers(robot.n)), size, use, rng))
    return clutter


def _change(without: Run, with_it: Run) -> Array:
    """Return the RMS difference of the torques of two runs with one reference, as a share of the RMS torque `with_it`, shape (n,)."""
    differ = np.sqrt(np.mean((with_it.tau - without.tau) ** 2, axis=0))
    return np.asarray(differ / np.sqrt(np.mean(with_it.tau**2, axis=0)))


def hidden_effect(key: dict[str, Any]) -> Effect:
    """Return the hidden effect that the key of a case describes."""
    joint = None if key["joint"] is None else key["joint"] - 1
    values = {k: np.array(v) if isinstance(v, list) else v for k, v in key["values"].items()}
    return _KINDS.get(key["effect"], Null)(joint, **values)
