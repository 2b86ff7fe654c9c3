"""Train on one half of a real log, score on the other, and the other way round: ``python -m tests.real_logs --help``."""

from __future__ import annotations

import functools
import tempfile
from collections.abc import Callable
from pathlib import Path

import click
import numpy as np
import polars as pl

import armgap

from .causes import Motion, torque_of, unknown
from .least_squares import Array, Columns, model_of, names_of, regression, share_left, solve

#: Column of the times [s].
TIME = "t"
#: Length of the shortest block that is used [s]; a second at either end is the filter's.
SHORTEST_S = 3.0


@click.command(name="python -m tests.real_logs", context_settings={"max_content_width": 100, "show_default": True})
@click.argument("log", type=click.Path(exists=True, dir_okay=False, path_type=Path))
@click.option(
    "--urdf", type=click.Path(exists=True, dir_okay=False, path_type=Path), required=True, help="Description."
)
@click.option("--arm", "arm_file", type=click.Path(exists=True, dir_okay=False, path_type=Path), required=True,
              help="Arm file made of it.")  # fmt: skip
@click.option(
    "--cutoff",
    type=click.FloatRange(min=0, min_open=True),
    default=1.0,
    help="Cut-off frequency of the score's filter [Hz].",
)
@click.option(
    "--block",
    type=click.FloatRange(min=0, min_open=True),
    help="Length of the blocks that are learnt from and scored by turns [s]; halves by default.",
)
def main(log: Path, urdf: Path, arm_file: Path, cutoff: float, block: float | None) -> None:
    """Compare the torque that a diagnosis of LOG leaves with that of inverse-dynamics least squares."""
    arm = armgap.Arm.read(arm_file)
    table = pl.read_parquet(log)
    t = table[TIME].to_numpy() - table[TIME][0]
    place = np.floor(t / (block or (t[-1] + 1e-9) / 2)).astype(int)
    with tempfile.TemporaryDirectory() as folder:
        parts: list[list[Path]] = [[], []]
        for number in range(place.max() + 1):
            part = table.filter(pl.Series(place == number))
            if not len(part) or part[TIME][-1] - part[TIME][0] < SHORTEST_S:
                click.echo(f"block {number} is too short and left out")
                continue
            file = Path(folder) / f"block-{number}.parquet"
            part.write_parquet(file)
            parts[number % 2].append(file)
        for training, holdout in (parts, parts[::-1]):
            click.echo(
                f"trained on {', '.join(f.stem for f in training)}, scored on {', '.join(f.stem for f in holdout)}"
            )
            _compare(arm, urdf, training, holdout, cutoff)


def _compare(arm: armgap.Arm, urdf: Path, training: list[Path], holdout: list[Path], cutoff: float) -> None:
    assert arm.chain is not None
    joints = list(arm.chain.joint_names)
    answer = armgap.diagnose(training, arm, holdout=holdout).to_dict()
    factors = np.ones(len(joints))
    for check in answer["checks"]:
        if check["severity"] != "repaired":
            continue
        if check["check"] != "torque_unit":
            raise click.ClickException(f"{check['message']}: this script repeats factors of torques only")
        joint, factor = check["remedies"][0].removeprefix("--factor tau").split("=")
        factors[int(joint) - 1] = float(factor)
    widths = np.array(answer["options"]["friction_widths"])
    model = model_of(urdf, joints)

    def rows(
        files: list[Path], beside: Callable[[Motion], Array] | None = None, links: Array | None = None
    ) -> list[tuple[Array, Array]]:
        logs = [_columns(pl.read_parquet(file), joints, factors) for file in files]
        return [regression(model, part, cutoff=cutoff, widths=widths, beside=beside, links=links) for part in logs]

    learnt, scored = rows(training), rows(holdout)
    period = float(np.median(np.diff(pl.read_parquet(training[0])[TIME].to_numpy())))
    tau, regressor = (np.concatenate([part[k] for part in learnt]) for k in (0, 1))

    def values(which: str, key: str = "value") -> Array:
        return np.array([answer["parameters"][which][name][key] for name in names_of(len(joints))])

    ours, free, prior = (
        share_left(scored, theta)
        for theta in (
            values("refit"),
            solve(tau, regressor),
            solve(tau, regressor, values("nominal"), values("nominal", "sigma"), 2.0 * cutoff * period),
        )
    )
    for j, name in enumerate(joints):
        click.echo(
            f"  {name:24} {100 * ours[j]:5.1f} %; least squares {100 * free[j]:5.1f} % (ratio {ours[j] / free[j]:.2f}), "
            f"with the arm file as prior {100 * prior[j]:5.1f} % ({ours[j] / prior[j]:.2f})"
        )
    if open_effects := unknown(answer["causes"]):
        click.echo(f"  with its causes: not scored, as the torque of {', '.join(open_effects)} is not known here")
    elif answer["causes"]:
        theta = values("with_causes")
        beside = functools.partial(torque_of, answer["causes"])
        left = share_left(rows(holdout, beside, theta[: 10 * len(joints)]), theta)
        of_free = ", ".join(f"{100 * x:.1f} % ({x / least:.2f})" for x, least in zip(left, free, strict=True))
        click.echo(f"  with its causes, and beside least squares: {of_free}")
    for cause in answer["causes"]:
        click.echo(f"  named: {cause['effect']} of joint {cause['joint']}, probability {cause['probability']:.2f}")
    said = sorted({(check["check"], check["joint"]) for check in answer["checks"]}, key=str)
    click.echo("  checks: " + ", ".join(f"{check} {joint}" for check, joint in said))
    for note in answer["notes"]:
        click.echo(f"  {note}")


def _columns(table: pl.DataFrame, joints: list[str], factors: np.ndarray) -> Columns:
    q, tau = (table.select([f"{joint}/{name}" for joint in joints]).to_numpy() for name in ("position", "effort"))
    return Columns(table[TIME].to_numpy().astype(float), q.astype(float), tau * factors)


if __name__ == "__main__":
    main()
