"""A linearised model: its matrices, names, units and values, and how good they are."""

from collections.abc import Sequence
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np

from msahl.analysis.linearised.steady import Equilibrium
from msahl.analysis.state_space.files import save
from msahl.records import record
from msahl.run.options import path_of

if TYPE_CHECKING:
    import control
    from scipy.signal import StateSpace

KINDS = ("state", "input", "output")


@record(slots=False)
class Quantity:
    """A state, input or output: its ``name``, ``unit``, and ``value`` at the point."""

    name: str
    unit: str
    value: float


@record(slots=False)
class Accuracy:
    """How good the matrices are."""

    condition: float  # of the choice of states
    disagreement: float  # of accelerations with differences of the nonlinear equations
    error: float  # of the derivatives of columns, relative to the largest of a table


@record(slots=False)
class LinearModel:
    """x' = A x + B w, y = C x + D w of changes from the values at the point; m states."""

    A: np.ndarray  # (m, m)
    B: np.ndarray  # (m, inputs)
    C: np.ndarray  # (outputs, m)
    D: np.ndarray  # (outputs, inputs)
    states: tuple[Quantity, ...]
    inputs: tuple[Quantity, ...]
    outputs: tuple[Quantity, ...]
    rates: np.ndarray  # (m,) rates of the states at the point; 0 in an equilibrium
    time: float  # [s]
    title: str
    equilibrium: Equilibrium  # how far the point is from one
    chosen: str  # which states: "coordinates" or "nullspace"
    accuracy: Accuracy
    redundant: int  # constraint equations that follow from others
    warnings: tuple[str, ...]

    @property
    def state_names(self) -> list[str]:
        """Names of the states."""
        return [state.name for state in self.states]

    @property
    def input_names(self) -> list[str]:
        """Names of the inputs."""
        return [variable.name for variable in self.inputs]

    @property
    def output_names(self) -> list[str]:
        """Names of the outputs."""
        return [variable.name for variable in self.outputs]

    @property
    def poles(self) -> np.ndarray:
        """(m,) eigenvalues of A [1/s], those with the largest real part first."""
        values = np.linalg.eigvals(self.A) if self.A.size else np.zeros(0, dtype=complex)
        found: np.ndarray = values[np.lexsort((-values.imag, -values.real))]
        return found

    def gains(self) -> np.ndarray:
        """(outputs, inputs) steady outputs by constant inputs, D - C A^-1 B; nan if A is singular:
        then a constant input moves the model away for ever.
        """
        if not self.A.size:
            return self.D.copy()
        size = np.linalg.svd(self.A, compute_uv=False)
        if size[-1] <= 1e-13 * size[0]:
            return np.full(self.D.shape, np.nan)
        gains: np.ndarray = self.D - self.C @ np.linalg.solve(self.A, self.B)
        return gains

    def save(self, path: "str | PathLike[str]") -> None:
        """Write matrices, names, units and values to a file .npz, .mat or .json."""
        save(self.contents(), path_of(path))

    def contents(self) -> dict[str, Any]:
        """Return what a file contains, by name: ``stateNames``, ``stateUnits``, ``stateValues`` and
        likewise of inputs and outputs, the matrices, and how good they are.
        """
        found: dict[str, Any] = {name: getattr(self, name) for name in "ABCD"}
        for kind in KINDS:
            each: tuple[Quantity, ...] = getattr(self, f"{kind}s")
            found[f"{kind}Names"] = [variable.name for variable in each]
            found[f"{kind}Units"] = [variable.unit for variable in each]
            found[f"{kind}Values"] = np.array([variable.value for variable in each])
        found["stateRates"] = self.rates
        found |= {"title": self.title, "time": self.time, "states": self.chosen}
        return found | {
            "residual": self.equilibrium.residual,
            "relativeResidual": self.equilibrium.relative,
            "isSteady": self.equilibrium.holds,
            "condition": self.accuracy.condition,
            "disagreement": self.accuracy.disagreement,
            "error": self.accuracy.error,
            "warnings": list(self.warnings),
        }

    def to_scipy(self) -> "StateSpace":
        """Return a ``scipy.signal.StateSpace``."""
        from scipy.signal import StateSpace

        return StateSpace(self.A, self.B, self.C, self.D)

    def to_control(self) -> "control.StateSpace":
        """Return a ``StateSpace`` of python-control (``pip install control``) with the names."""
        import control

        return control.ss(
            self.A,
            self.B,
            self.C,
            self.D,
            states=_labels(self.state_names),
            inputs=_labels(self.input_names),
            outputs=_labels(self.output_names),
            name=_labels([self.title or "model"])[0],
        )


def _labels(names: Sequence[str]) -> list[str]:
    """Names as python-control accepts them: it splits signals at points."""
    return [name.replace(".", "_") for name in names]
