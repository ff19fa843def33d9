"""Values that Hainge (2010, chapter IV) printed of his runs."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Printed:
    """A run of ``deck`` with step ``dt`` to ``t_final`` [s], and the "RMS" values printed of it.

    ``reached`` [s] is where it stopped, if it did; ``work`` one value a joint [J]; ``figures`` the
    numbers of its pictures in chapter IV.
    """

    deck: str
    dt: float
    t_final: float
    energy: float | None
    work: tuple[float, ...]
    figures: str
    reached: float | None = None


RUNS = (
    Printed("single_pendulum_45", 0.01, 10.0, None, (2.04332e-05,), "10-12"),
    Printed("single_pendulum_45", 0.02, 100.0, 1.37740e-08, (4.08278e-06,), "13-14"),
    Printed("single_pendulum_89", 0.004, 10.0, None, (4.2994e-07,), "15-17"),
    Printed("single_pendulum_89", 0.01, 100.0, 1.9464e-08, (1.8670e-06,), "18-19"),
    Printed("single_pendulum_135", 0.004, 10.0, None, (1.5400e-04,), "20-22"),
    Printed("single_pendulum_135", 0.01, 100.0, 7.0930e-08, (9.3934e-06,), "23-24"),
    Printed("double_pendulum_45", 0.002, 10.0, 7.5496e-08, (1.7163e-05, 3.5257e-05), "34-37"),
    Printed(
        "double_pendulum_45", 0.003, 100.0, 4.6614e-08, (1.6539e-06, -8.5665e-06), "38-40", 26.0
    ),
    Printed("double_pendulum_89", 0.002, 10.0, None, (8.290e-05, 2.346e-05), "41-44"),
    Printed(
        "double_pendulum_89", 0.002, 100.0, 4.6614e-08, (1.6539e-06, -8.5665e-06), "45-47", 25.0
    ),
    Printed("double_pendulum_135", 0.002, 10.0, None, (8.290e-05, 2.346e-05), "48-51"),
    Printed(
        "double_pendulum_135", 0.002, 100.0, 9.9443e-08, (-5.0424e-07, -1.7151e-05), "52-54", 19.0
    ),
    Printed("top_1", 0.002, 10.0, 2.201e-06, (-2.071e-05,), "62-64"),
    Printed("top_1", 0.002, 100.0, 2.207e-07, (-2.073e-06,), "65-67"),
    Printed("top_2", 0.002, 10.0, 5.052e-07, (-1.009e-06,), "68-70"),
    Printed("top_2", 0.002, 100.0, 5.044e-08, (-1.011e-07,), "71-73"),
    Printed("top_3", 0.002, 10.0, 8.815e-08, (-1.175e-10,), "74-76"),
    Printed("top_3", 0.002, 100.0, 8.770e-08, (-8.075e-12,), "77-79"),
)

STEPS = (0.1, 0.04, 0.01, 0.004, 0.002)
"""His sample rates (tables 4.2, 4.4, 4.6, 4.8) [s]."""

TRENDS = (
    ("single", ("single_pendulum_45", "single_pendulum_89", "single_pendulum_135"), "4.1 to 4.9"),
    ("double", ("double_pendulum_45", "double_pendulum_89", "double_pendulum_135"), "4.25 to 4.33"),
    ("top", ("top_1", "top_2", "top_3"), "4.59 to 4.61"),
)
"""Models whose trends with the step size he draws together, and his figures."""

TRIPLES = ("triple_pendulum_45", "triple_pendulum_89", "triple_pendulum_135")
"""Models of which no step converged."""
