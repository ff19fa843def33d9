"""What Hainge (2010, chapter IV) says of his runs: which came to their end, which did not."""

PROBLEMS = (
    "single_pendulum_45",
    "single_pendulum_89",
    "single_pendulum_135",
    "double_pendulum_45",
    "double_pendulum_89",
    "double_pendulum_135",
    "triple_pendulum_45",
    "triple_pendulum_89",
    "triple_pendulum_135",
    "top_1",
    "top_2",
    "top_3",
)
STEPS = (0.1, 0.04, 0.01, 0.004, 0.002)

_SINGLE_45 = dict(zip(STEPS, (True, True, True, False, False), strict=True))
_SINGLE = dict(zip(STEPS, (True, True, True, True, False), strict=True))
_ALL, _NONE = dict.fromkeys(STEPS, True), dict.fromkeys(STEPS, False)

TEN_SECONDS = {
    "single_pendulum_45": _SINGLE_45,
    "single_pendulum_89": _SINGLE,
    "single_pendulum_135": _SINGLE,
    "double_pendulum_45": _ALL,
    "double_pendulum_89": {0.002: True},
    "double_pendulum_135": {0.002: True},
    **{problem: _NONE for problem in PROBLEMS if problem.startswith("triple")},
    **{problem: _ALL for problem in PROBLEMS if problem.startswith("top")},
}
"""Whether the run of 10 s was completed; steps that are not reported are omitted."""

HUNDRED_SECONDS = {
    "single_pendulum_45": {0.01: False, 0.004: False, 0.002: False},
    "single_pendulum_89": {0.01: True, 0.004: False, 0.002: False},
    "single_pendulum_135": {0.01: True, 0.004: False, 0.002: False},
    "double_pendulum_89": _NONE,
    "double_pendulum_135": _NONE,
    **{problem: _NONE for problem in PROBLEMS if problem.startswith("triple")},
    **{problem: {0.002: True} for problem in PROBLEMS if problem.startswith("top")},
}
"""Likewise of 100 s. Of the double pendulum at 45 degrees it says that 0.003 s was used and came
to 26 s; at 89 and 135 degrees 0.002 s came to 25 s and to 19 s."""
