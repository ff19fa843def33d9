"""A deck for tests of sweeps: a pendulum on a hinge that runs in milliseconds."""

from tests.support.models import ROOT

DECK = ROOT / "decks" / "basics" / "parameters.xml"
QUICK = {"t_final": 0.1}
