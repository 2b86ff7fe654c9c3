from collections.abc import Callable, Sequence
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "Chain",
    "Estimator",
    "__version__",
    "arm_kinds",
    "bench",
    "bounded_least_squares",
    "diagnose",
    "diagnosis_schema",
    "effects",
    "filtered_torques",
    "fit",
    "inertia",
    "refit",
    "regression_rows",
    "simulate",
    "simulate_windows",
    "theta_from_links",
    "velocity",
]

__version__: str

_Floats = NDArray[np.float64]
_Reference = tuple[_Floats, _Floats | None]
_Log = tuple[str, str, _Floats, _Floats, _Floats, Sequence[_Floats], _Floats | None, _Reference | None]

def arm_kinds() -> list[dict[str, Any]]: ...
def effects() -> list[dict[str, Any]]: ...
def theta_from_links(
    kind: str,
    gravity: float,
    mass: Sequence[float],
    length: Sequence[float],
    com: Sequence[float],
    inertia: Sequence[float],
) -> NDArray[np.float64]: ...
def simulate(
    kind: str,
    gravity: float,
    link_length: Sequence[float] | None,
    theta: Sequence[float],
    t: NDArray[np.float64],
    tau: NDArray[np.float64],
    q0: NDArray[np.float64],
    dq0: NDArray[np.float64],
    effects: Sequence[tuple[str, int | None, dict[str, float]]],
    tolerance: float = 1e-9,
    smoothing: Sequence[float] = ...,
    progress: Callable[[str, float], object] | None = None,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]: ...
def simulate_windows(
    kind: str,
    gravity: float,
    link_length: Sequence[float] | None,
    theta: Sequence[float],
    t: NDArray[np.float64],
    tau: NDArray[np.float64],
    rows: Sequence[tuple[int, int]],
    samples: int,
    q0: NDArray[np.float64],
    dq0: NDArray[np.float64],
    effects: Sequence[tuple[str, int | None, dict[str, float]]],
    tolerance: float = 1e-9,
    smoothing: Sequence[float] = ...,
    substeps: Sequence[int] | None = None,
    max_substeps: int = ...,
) -> tuple[NDArray[np.float64], NDArray[np.float64], list[int]]: ...
def inertia(
    kind: str,
    gravity: float,
    link_length: Sequence[float] | None,
    theta: Sequence[float],
    q: NDArray[np.float64],
    effects: Sequence[tuple[str, int | None, dict[str, float]]],
) -> NDArray[np.float64]: ...
def diagnose(
    arm: dict[str, Any],
    training: Sequence[_Log],
    holdout: Sequence[_Log],
    options: dict[str, Any],
    progress: Callable[[str, float], object] | None = None,
) -> str: ...
def diagnosis_schema() -> str: ...
def refit(
    arm: dict[str, Any], start: Sequence[float], training: Sequence[_Log], holdout: Sequence[_Log], horizon: float
) -> dict[str, list[float]]: ...
def regression_rows(
    arm: dict[str, Any],
    t: NDArray[np.float64],
    q: NDArray[np.float64],
    tau: NDArray[np.float64],
    cutoff: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]: ...
def filtered_torques(t: NDArray[np.float64], tau: NDArray[np.float64], cutoff: float) -> NDArray[np.float64]: ...
def bounded_least_squares(
    gram: NDArray[np.float64], right: NDArray[np.float64], low: NDArray[np.float64], high: NDArray[np.float64]
) -> NDArray[np.float64]: ...
def fit(
    arm: dict[str, Any],
    t: NDArray[np.float64],
    q: NDArray[np.float64],
    tau: NDArray[np.float64],
    horizon: float,
) -> dict[str, Any] | None: ...
def velocity(
    t: NDArray[np.float64], q: NDArray[np.float64], method: str, half_width: int = 3
) -> NDArray[np.float64]: ...
def bench(
    scheme: str | None, paper: bool, plain: bool, single: bool, samples: int
) -> tuple[float, float, float, float, float]: ...

@final
class Estimator:
    def __new__(
        cls,
        kind: str,
        scheme: str,
        paper: bool,
        form: str | None,
        asymmetry: bool,
        single: bool,
        numbers: Sequence[float],
        counts: Sequence[int],
        theta0: Sequence[float],
    ) -> Estimator: ...
    @staticmethod
    def of_chain(
        chain: Chain,
        columns: Sequence[int],
        known: Sequence[float],
        scheme: str,
        paper: bool,
        form: str | None,
        single: bool,
        numbers: Sequence[float],
        counts: Sequence[int],
        theta0: Sequence[float],
    ) -> Estimator: ...
    def update(
        self,
        when: float,
        after: bool,
        q: NDArray[np.float64],
        dq: NDArray[np.float64] | None,
        tau: NDArray[np.float64],
    ) -> int: ...
    def run(
        self,
        when: NDArray[np.float64],
        after: bool,
        q: NDArray[np.float64],
        dq: NDArray[np.float64] | None,
        tau: NDArray[np.float64],
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.uint8]]: ...
    def copy(self) -> Estimator: ...
    @property
    def theta(self) -> NDArray[np.float64]: ...
    @property
    def sigma(self) -> NDArray[np.float64]: ...
    @property
    def covariance(self) -> NDArray[np.float64]: ...
    @property
    def errors(self) -> NDArray[np.float64]: ...
    @property
    def signals(self) -> tuple[float, float]: ...
    @property
    def counts(self) -> tuple[int, int]: ...

@final
class Chain:
    def __new__(
        cls,
        kinds: Sequence[str],
        rotation: NDArray[np.float64],
        translation: NDArray[np.float64],
        axis: NDArray[np.float64],
        gravity: NDArray[np.float64],
    ) -> Chain: ...
    @property
    def n_joints(self) -> int: ...
    @property
    def parameter_names(self) -> list[str]: ...
    @property
    def parameter_units(self) -> list[str]: ...
    def base_parameters(self, candidates: Sequence[int]) -> tuple[list[int], list[int], _Floats]: ...
    def inertia(self, theta: Sequence[float] | _Floats, q: _Floats) -> _Floats: ...
    def bias(self, theta: Sequence[float] | _Floats, q: _Floats, dq: _Floats) -> _Floats: ...
    def inverse_dynamics(self, theta: Sequence[float] | _Floats, q: _Floats, dq: _Floats, ddq: _Floats) -> _Floats: ...
    def torque_derivatives(
        self, theta: Sequence[float] | _Floats, q: _Floats, dq: _Floats, ddq: _Floats
    ) -> tuple[_Floats, _Floats]: ...
    def acceleration(self, theta: Sequence[float] | _Floats, q: _Floats, dq: _Floats, tau: _Floats) -> _Floats: ...
    def regressor(self, q: _Floats, dq: _Floats, ddq: _Floats) -> _Floats: ...
    def momentum_regressor(self, q: _Floats, dq: _Floats) -> _Floats: ...
    def potential_regressor(self, q: _Floats, dq: _Floats) -> _Floats: ...
    def energy_regressor(self, q: _Floats, dq: _Floats) -> _Floats: ...
    def energies(self, theta: Sequence[float] | _Floats, q: _Floats, dq: _Floats) -> tuple[_Floats, _Floats]: ...
    def simulate(
        self,
        theta: Sequence[float] | _Floats,
        t: _Floats,
        tau: _Floats,
        q0: _Floats,
        dq0: _Floats,
        effects: Sequence[tuple[str, int | None, dict[str, float]]],
        tolerance: float = 1e-9,
        smoothing: Sequence[float] = ...,
        progress: Callable[[str, float], object] | None = None,
    ) -> tuple[_Floats, _Floats]: ...
