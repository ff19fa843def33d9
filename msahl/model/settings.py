"""How a run is made: what the deck and the command line ask for, and ``resolve``, which decides it.

``Simulation`` holds the deck's ``<simulation>``, ``Options`` what the user chose beside the deck.
``resolve`` combines both into ``RunSettings``, where no choice is left open. The rest of
the program reads ``RunSettings`` and does not decode ``Simulation`` itself.
"""

from msahl.model.contacts import POISSON
from msahl.model.scheme import (
    AUTO,
    AUTO_FAMILY,
    CAYLEY,
    COLLOCATION,
    DAMPING,
    DEFAULT,
    DEGREE,
    EXPLICIT,
    EXPONENTIAL,
    ORDER_TWO,
    TOLERANCE,
    Decay,
    decaying,
)
from msahl.records import record

MEAN, INSTANTANEOUS = "mean", "instantaneous"
"""Published reactions: means over the step before an output time, or those at that time."""
YES, NO = "yes", "no"
AUTOMATIC = "auto"
JOINT_TABLES = (AUTOMATIC, YES, NO)
"""Whether the coordinates of joints are written; automatic: of models with angles or slides, unless
they have very many joints."""
ACCELERATIONS = (NO, YES)
GIVEN, EQUILIBRIUM = STARTS = ("given", "equilibrium")
"""Where a run starts: where the deck has the bodies, or at rest in an equilibrium."""
ESTIMATE, LOCAL, OFF = ERRORS = ("estimate", "local", "off")
"""What a run finds out about its error: the global error, the sum of local errors, nothing."""
SOLVERS = ("auto", "newton", "root")
"""Compiled Newton iteration, scipy.optimize.root, or Newton with root for the steps it fails on."""


@record
class Limits:
    """Limits that the deck sets for the verdict; None leaves the default of ``run.verdict``.

    ``accuracy`` [m] of positions; ``energy``, the error of the energy balance relative to the
    largest kinetic energy; ``violation`` [m] of the constraints.
    """

    accuracy: float | None = None
    energy: float | None = None
    violation: float | None = None


@record
class Simulation:
    """What the deck says about its run.

    ``dt`` is the step size and ``t_final`` the end [s]. ``damping`` belongs to the scheme
    "decaying": 0 damps nothing, 1 removes the fastest motions within one step. ``degree`` belongs
    to gauss and radau. ``rotation_update`` says how the mean angular velocity of a step rotates a
    body, ``reactions`` whether reactions are means or instantaneous, ``accelerations`` whether they
    are written, ``joint_table`` whether the coordinates of joints are. ``output_interval`` [s] is
    the time between output times, None for the step size. The step size is controlled by
    ``tolerance`` [m] of the global error or by ``local_tolerance`` [m] of the sum of local errors;
    ``dt`` is then the first step size tried. ``start`` is one of ``STARTS``, ``impact_law`` one
    of ``IMPACT_LAWS``.
    """

    title: str
    dt: float
    t_final: float
    scheme: str = DEFAULT
    damping: float = DAMPING
    rotation_update: str = CAYLEY
    reactions: str = MEAN
    limits: Limits = Limits()
    degree: int = DEGREE
    output_interval: float | None = None
    tolerance: float | None = None
    local_tolerance: float | None = None
    accelerations: str = NO
    joint_table: str = AUTOMATIC
    start: str = GIVEN
    impact_law: str = POISSON


@record
class Options:
    """What the user chose beside the deck.

    ``full`` switches off the model reductions, ``accuracy`` [m] replaces the deck's limit, and
    ``error`` is one of ``ERRORS``: None estimates the global error where that is cheap.
    """

    solver: str = "auto"
    every: int = 1
    full: bool = False
    accuracy: float | None = None
    error: str | None = None


@record
class RunSettings:
    """How a run is made, with every default filled in."""

    dt: float  # step size, or the first one tried if the step size is controlled [s]
    t_final: float  # [s]
    output_interval: float | None  # [s]; None: the step size
    scheme: str  # as asked for, so it may be "auto"
    family: str  # of the steps taken: preserving, decaying, gauss, radau, rk4 or rk8
    degree: int  # of gauss and radau, the highest one if it is chosen; half the order of an
    # explicit scheme, that of gauss with the same order; 0 for the schemes of order 2
    order: int  # of convergence of the states
    dissipative: bool  # whether the scheme takes energy from the model
    damping: float  # of the scheme "decaying", 0 for the others
    decay: Decay  # coefficients of the schemes of order 2
    exponential: bool  # whether rotations are updated by the exponential map
    reactions: str  # MEAN or INSTANTANEOUS
    accelerations: str  # of bodies: NO or YES
    joint_table: str  # coordinates of joints: AUTOMATIC, YES or NO
    tolerance: float | None  # of the global error, by which the step size is chosen [m]
    local_tolerance: float | None  # of the sum of local errors, likewise [m]
    solver: str
    every: int  # output times from one row of the tables to the next
    full: bool
    error: str | None
    accuracy: float | None  # limit of the position error [m]
    limits: Limits

    @property
    def adaptive(self) -> bool:
        """Whether the step size follows from a tolerance."""
        return self.local_tolerance is not None

    @property
    def explicit(self) -> bool:
        """Whether steps are explicit: nothing is solved for, and energy drifts."""
        return self.family in EXPLICIT

    @property
    def instantaneous(self) -> bool:
        """Whether reactions are those at the output times, not means over the steps before."""
        return self.reactions == INSTANTANEOUS

    @property
    def degrees(self) -> tuple[int, ...]:
        """Degrees that the step-size control chooses from."""
        return tuple(range(1, self.degree + 1)) if self.scheme == AUTO else (self.degree,)


def resolve(simulation: Simulation, options: Options = Options()) -> RunSettings:
    """Settings of the run that ``simulation`` and ``options`` ask for."""
    family = AUTO_FAMILY if simulation.scheme == AUTO else simulation.scheme
    collocation = COLLOCATION.get(family)
    degree = 0
    if collocation:
        degree = collocation.highest if simulation.scheme == AUTO else simulation.degree
    explicit = EXPLICIT.get(family)
    if explicit:
        degree = explicit // 2
    decay = ORDER_TWO[family](simulation.damping) if degree == 0 else decaying(0.0)
    tolerance = _global_tolerance(simulation) if collocation else None
    local = simulation.local_tolerance or tolerance if collocation else None
    return RunSettings(
        dt=simulation.dt,
        t_final=simulation.t_final,
        output_interval=simulation.output_interval,
        scheme=simulation.scheme,
        family=family,
        degree=degree,
        order=collocation.order(degree) if collocation else explicit or 2,
        dissipative=collocation.decays if collocation else decay.chi > 0.0,
        damping=simulation.damping if decay.chi > 0.0 else 0.0,
        decay=decay,
        exponential=simulation.rotation_update == EXPONENTIAL and degree == 0,
        reactions=INSTANTANEOUS if degree else simulation.reactions,
        accelerations=simulation.accelerations,
        joint_table=simulation.joint_table,
        tolerance=tolerance,
        local_tolerance=local,
        solver=options.solver,
        every=options.every,
        full=options.full,
        error=options.error,
        accuracy=options.accuracy or simulation.limits.accuracy,
        limits=simulation.limits,
    )


def _global_tolerance(simulation: Simulation) -> float | None:
    """Bound of the global error [m] that a collocation scheme must meet, None if there is none."""
    if simulation.local_tolerance is not None:
        return None
    return simulation.tolerance or (TOLERANCE if simulation.scheme == AUTO else None)
