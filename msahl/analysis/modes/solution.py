"""Modes of a model: eigenvalues, frequencies, damping and shapes of its small vibrations.

    dq(t) = Re (q e^(lambda t)) ,  frequency |lambda|/(2 pi) [Hz],  damping -Re lambda/|lambda|

A model whose motion is no equilibrium and not steady has no modes in the strict sense: then they
are those of its coefficients at this moment.
"""

from typing import NamedTuple

import numpy as np

from msahl.algebra.rotation import matrix
from msahl.algebra.vector import at
from msahl.analysis.linearised.coefficients import Coefficients, coefficients, depends_on_reactions
from msahl.analysis.linearised.contact_lines import slides
from msahl.analysis.linearised.point import Point
from msahl.analysis.linearised.rate_gradients import rates_by_place
from msahl.analysis.linearised.reduced import LinearSystem, linear_system, stiffness_weight
from msahl.analysis.linearised.steady import Equilibrium, equilibrium
from msahl.analysis.linearised.variations import with_reactions
from msahl.analysis.modes.eigenvalues import CANCELLED, eigenvalues
from msahl.analysis.modes.sparse_eigenvalues import (
    MOST_RIGID,
    NotFoundError,
    Pencil,
    is_worthwhile,
    nearest,
    pencil,
    without_stiffness,
)
from msahl.analysis.modes.zero_eigenvalues import MOST as MOST_ZEROS
from msahl.run.hidden_bodies import shown_numbers
from msahl.run.options import OptionError
from msahl.start.velocities import StartError
from msahl.system.names import describe_row

AUTO, DENSE, SPARSE = METHODS = ("auto", "dense", "sparse")
LARGEST_DENSE = 600
"""Most coordinates (six a body) of a model of which all modes are computed by dense matrices."""
FEW = 10
"""Modes of a larger model that are computed unless more are wanted."""
SHAPE_COLUMNS = ("x", "y", "z", "rx", "ry", "rz")
"""Displacement of a body's reference point and rotation vector, inertial axes [m, rad]."""
COLUMNS = ("mode", "real", "imaginary", "frequency", "damping", "condition", "error")
"""Of modes.csv."""


class Modes(NamedTuple):
    """Eigenvalues with imaginary part >= 0, the zeros first; m of them, b bodies, s states."""

    value: np.ndarray  # (m,) complex [1/s]
    condition: np.ndarray  # (m,) condition number; nan of zeros
    error: np.ndarray  # (m,) what round-off changes [1/s]
    zeros: int  # eigenvalues that are zero
    rigid: int  # rigid-body modes: eigenvectors of these
    shape: np.ndarray  # (m, b, 6) complex, columns ``SHAPE_COLUMNS``
    states: np.ndarray  # (m, s) complex, auxiliary states
    equilibrium: Equilibrium
    degrees_of_freedom: int
    redundant: int
    warnings: list[str]
    stages: tuple[int, ...] = ()  # see ``Eigenvalues``

    @property
    def frequency(self) -> np.ndarray:
        """(m,) undamped natural frequencies [Hz]."""
        return np.abs(self.value) / (2.0 * np.pi)

    @property
    def damping(self) -> np.ndarray:
        """(m,) damping ratios; 0 of zeros."""
        size = np.abs(self.value)
        ratio = np.divide(-self.value.real, size, out=np.zeros(size.size), where=size > 0.0)
        return ratio + 0.0  # no -0


def modes(
    point: Point,
    number: int | None = None,
    frequency: float = 0.0,
    method: str = AUTO,
    nearby: Modes | None = None,
) -> Modes:
    """Return the modes at a ``point``: zeros and the ``number`` nearest to a ``frequency`` [Hz], by
    default all of a small model without beams. Raises ``StartError`` if a large model has too many
    zeros.

    With modes ``nearby``, those of nearly the same model, so many eigenvalues are zero as there
    (dense matrices only), and the motion is as steady as there.
    """
    _require_possible(number, frequency, method)
    found = coefficients(point.system, point.state)
    if nearby is not None and not nearby.equilibrium.axes.any():
        state = nearby.equilibrium
    else:
        state = equilibrium(point, found)
    large = is_large(point)
    if method == SPARSE or (method == AUTO and (large or _is_stiff(point))):
        if large and not frequency:
            _require_few_zeros(found)
        matrices = pencil(found, state.axes)
        if large and not frequency:
            _require_stiffness(matrices)
        if is_worthwhile(matrices, number or FEW):
            try:
                return _sparse(point, found, state, matrices, (number or FEW, frequency))
            except StartError:
                if method == SPARSE or large:
                    raise
    dense = _dense(point, found, state, None if nearby is None else nearby.stages)
    return _nearest(dense, number, frequency)


def _require_possible(number: int | None, frequency: float, method: str) -> None:
    """Raise ``OptionError`` for what no model has."""
    faults = []
    if number is not None and number < 1:
        faults.append(f"number {number}: ask for at least one mode")
    if not 0.0 <= frequency < np.inf:
        faults.append(f"near {frequency:g}: give a frequency in Hz, zero or more")
    if method not in METHODS:
        faults.append(f"method '{method}': choose one of {', '.join(METHODS)}")
    if faults:
        raise OptionError(faults)


def _require_few_zeros(found: Coefficients) -> None:
    """Raise ``StartError`` if so many coordinates have neither a stiffness nor a constraint that
    their zeros cannot be told from other eigenvalues: a bound that needs no matrix.
    """
    stiff = np.unique(found.by_place.tocoo().row).size
    zeros = found.coordinate.size - stiff - found.constraint.shape[0]
    if zeros > MOST_ZEROS:
        raise _too_many(zeros)


def _require_stiffness(of: Pencil) -> None:
    """Raise ``StartError`` if the stiffness has so many directions without any, as those across
    single springs, that there are too many zeros: counted by one factorisation, where eigenvectors
    would be sought for minutes.
    """
    zeros = without_stiffness(of) - of.independent
    if zeros > (MOST_ZEROS if of.stiffness is None else MOST_RIGID):
        raise _too_many(zeros)


def _too_many(zeros: int) -> StartError:
    return StartError(
        f"at least {zeros} rigid-body modes: nothing holds these displacements and rotations, "
        "and eigenvalues beside so many zeros cannot be found; hold the bodies by joints or "
        "springs, or ask for modes near a frequency (--near)"
    )


def coordinate_count(point: Point) -> int:
    """Return the number of coordinates of a model, six a body."""
    return 6 * len(point.model.bodies)


def is_large(point: Point) -> bool:
    """Return whether a model is too large for dense matrices."""
    return coordinate_count(point) > LARGEST_DENSE


def _is_stiff(point: Point) -> bool:
    """Whether the highest frequencies are so far above the lowest that dense matrices lose their
    digits, which sparse ones keep: in beams, unless only dense matrices have all derivatives.
    """
    return bool(point.model.beams) and not depends_on_reactions(point.system)


def _nearest(found: Modes, number: int | None, frequency: float) -> Modes:
    """Return the zeros and the ``number`` modes nearest to a ``frequency`` [Hz]."""
    if number is None:
        return found
    distance = np.abs(found.value[found.zeros :] - 2j * np.pi * frequency)
    kept = np.sort(found.zeros + np.argsort(distance, kind="stable")[:number])
    kept = np.concatenate([np.arange(found.zeros), kept])
    fields = ("value", "condition", "error", "shape", "states")
    return found._replace(**{name: getattr(found, name)[kept] for name in fields})


def _sparse(
    point: Point,
    found: Coefficients,
    state: Equilibrium,
    pencil: Pencil,
    wanted: tuple[int, float],
) -> Modes:
    """Modes of a large model, ``wanted`` by their number and the frequency nearby."""
    number, frequency = wanted
    try:
        result = nearest(pencil, number, frequency)
    except NotFoundError:
        where = f"{frequency:.9g} Hz" if frequency else "zero"
        raise StartError(
            f"eigenvalues near {where} cannot be separated: one is there, or many are nearly "
            "equal; ask for modes near another frequency (--near), or, of a model that is not very "
            "large, for all (--method dense)"
        ) from None
    found_modes = Modes(
        value=result.value,
        condition=result.condition,
        error=result.error,
        zeros=result.zeros,
        rigid=result.rigid,
        shape=np.zeros((0, 0, 0)),
        states=result.states.T,
        equilibrium=state,
        degrees_of_freedom=pencil.coordinates - pencil.independent,
        redundant=pencil.redundant,
        warnings=[*warnings(point, state), *_omitted(point)],
    )
    places, states = _normalised(found, result.places, result.states)
    found_modes = found_modes._replace(shape=_shapes(point, found, places), states=states.T)
    return _nearest(found_modes, number, frequency)


def _dense(
    point: Point, found: Coefficients, state: Equilibrium, stages: tuple[int, ...] | None
) -> Modes:
    """All modes; see ``eigenvalues`` for ``stages``."""
    rates = rates_by_place(point.system, point.state)
    system = with_reactions(point, found, linear_system(found, rates, state.axes), state.axes)
    weight = stiffness_weight(found, system, point.pressing)
    A = _without_cancelled(system, weight) if point.pressing else system.A
    result = eigenvalues(A, stages, weight)
    kept = result.value.imag >= 0.0
    vectors = result.vector[:, kept]
    places, states = _normalised(found, system.places @ vectors, system.states @ vectors)
    return Modes(
        value=result.value[kept],
        condition=result.condition[kept],
        error=result.error[kept],
        zeros=result.zeros,
        rigid=result.null,
        shape=_shapes(point, found, places),
        states=states.T,
        equilibrium=state,
        degrees_of_freedom=system.rate_degrees_of_freedom,
        redundant=system.redundant,
        warnings=warnings(point, state),
        stages=result.stages,
    )


def _without_cancelled(system: LinearSystem, weight: np.ndarray) -> np.ndarray:
    """(m, m) A, whose stiffness has no round-off of forces of contacts that cancel each other."""
    d, A = system.degrees_of_freedom, system.A.copy()
    terms = np.linalg.norm(weight, axis=0)
    K = A[d : d + system.rate_degrees_of_freedom, :d]
    if K.shape == (d, d):
        K[np.abs(K) <= CANCELLED * np.finfo(float).eps * np.outer(terms, terms)] = 0.0
    return A


def warnings(point: Point, state: Equilibrium) -> list[str]:
    """Return why the modes are not those of an equilibrium, or not exact."""
    found = []
    if state.relative > 0.0 and not state.holds and state.residual > 0.0:
        where = describe_row(point.model, point.system, _flat(point, state))
        found.append(
            f"this is no equilibrium and no steady motion: {state.residual:.3g} N are not balanced "
            f"({where}); the modes are those of the coefficients at this moment. Find an "
            "equilibrium first, or choose another time"
        )
    elif not state.holds:
        found.append(
            "this motion is not steady: its coefficients change with time, in every axes tried; "
            "the modes are those of the coefficients at this moment"
        )
    if slides(point):
        found.append(
            "contacts slide: the derivatives omit how friction changes with their normal force"
        )
    return found


def _omitted(point: Point) -> list[str]:
    """Return what sparse matrices do not contain."""
    if not depends_on_reactions(point.system):
        return []
    return [
        "forces depend on reactions of joints (friction or expressions); the derivatives omit how "
        "these change, which those of dense matrices contain (--method dense)"
    ]


def _flat(point: Point, state: Equilibrium) -> int:
    """Number of the unbalanced equation among the flat ones."""
    from msahl.analysis.linearised.plain_units import coordinate_numbers

    return int(coordinate_numbers(point.system)[state.coordinate])


def _normalised(
    found: Coefficients, places: np.ndarray, states: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Shapes whose largest displacement or rotation, times a length, is 1; of modes of auxiliary
    states alone the largest of these.
    """
    for m in range(places.shape[1]):
        sizes = found.length * places[:, m]
        if not np.abs(sizes).max(initial=0.0) > 1e-12 * np.abs(states[:, m]).max(initial=0.0):
            sizes = states[:, m]
        largest = sizes[np.argmax(np.abs(sizes))] if sizes.size else 0.0
        if largest != 0.0:
            places[:, m] /= largest
            states[:, m] /= largest
    return places, states


def _shapes(point: Point, found: Coefficients, places: np.ndarray) -> np.ndarray:
    """(m, b, 6) displacements of reference points, and rotations, of all bodies."""
    system, n = point.system, len(point.model.bodies)
    place = np.full(int(found.coordinate.max(initial=0)) + 1, -1)
    place[found.coordinate] = np.arange(found.coordinate.size)
    shape = np.zeros((places.shape[1], n, 6), dtype=complex)
    for b in range(n):
        f = int(system.bodies.frame[b])
        u = places[place[3 * system.frames.displacement[f] + np.arange(3)]].T
        theta = places[place[3 * system.frames.rotation[f] + np.arange(3)]].T
        arm = np.array(matrix(at(point.state.p, f))) @ system.bodies.r_BG[b]
        shape[:, b, :3], shape[:, b, 3:] = u - np.cross(theta, arm), theta
    return shape


def mode_rows(found: Modes) -> np.ndarray:
    """(m, 7) the rows of modes.csv; the condition of a zero is 0."""
    return np.column_stack(
        [
            np.arange(1, found.value.size + 1),
            found.value.real,
            found.value.imag,
            found.frequency,
            found.damping,
            np.nan_to_num(found.condition),
            found.error,
        ]
    )


def shape_columns(point: Point) -> list[str]:
    """Header of shapes.csv."""
    names = [f"{body.name}.{c}" for body in point.model.shown_bodies for c in SHAPE_COLUMNS]
    names += [s.name for s in point.model.states]
    return ["mode", *(f"{name}.{part}" for name in names for part in ("real", "imaginary"))]


def shape_parts(point: Point, found: Modes) -> np.ndarray:
    """(m, ...) the parts of all shapes, of the bodies that are shown and of auxiliary states."""
    shown = found.shape[:, shown_numbers(point.model)]
    m, n, width = shown.shape
    return np.concatenate([shown.reshape(m, n * width), found.states], axis=1)


def shape_rows(point: Point, found: Modes) -> np.ndarray:
    """(m, ...) the rows of shapes.csv."""
    values = shape_parts(point, found)
    m = len(values)
    parts = np.stack([values.real, values.imag], axis=2).reshape(m, 2 * values.shape[1])
    return np.column_stack([np.arange(1, m + 1), parts])
