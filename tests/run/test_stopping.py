"""Requests to stop are answered in every loop: in hard steps, in chunks, and where none is."""

import json
import os
import signal
import time
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner

import msahl.cli.interruption
import msahl.run.loop
from msahl.cli.interruption import stoppable
from msahl.cli.main import main
from msahl.model import Options
from msahl.run.subsystem import SubsystemIntegrator
from msahl.run.tables import TABLES
from msahl.schemes import outcome
from msahl.schemes.collocation import step_control
from msahl.schemes.stepper import Chunk
from tests.support.models import ROOT, deck, pendulum, run_in_memory

SINGLE = ROOT / "decks" / "thesis" / "single_pendulum_45.xml"


def violent(**simulation):
    """Steps of 0.15 s that are subdivided at times, by scipy."""
    model = deck("triple_pendulum_135")
    return replace(model, simulation=replace(model.simulation, dt=0.15, t_final=6.0, **simulation))


def advance(model, options, **others):
    report, sink = run_in_memory(model, options, **others)
    return report, [sink.table(name) for name in TABLES]


@pytest.mark.parametrize("solver", ["auto", "root"])
@pytest.mark.parametrize("asked", [1, 4])
def test_a_hard_step_that_is_stopped_is_taken_anew_when_the_run_goes_on(monkeypatch, asked, solver):
    """Bit for bit the rows of the run that was not stopped, though it stopped within a step."""
    monkeypatch.setattr(outcome, "ASKED_AFTER", 30_000)  # one or two evaluations
    complete, rows = advance(violent(), Options(solver))
    counted, saved = [], []

    def stopped():
        counted.append(None)
        return len(counted) == asked

    # One chunk for all steps: the loop itself never asks before the end.
    monkeypatch.setattr(msahl.run.loop, "CHUNK_SECONDS", 1e9)
    monkeypatch.setattr(msahl.run.loop, "PATIENCE", 1e9)
    first, begun = advance(violent(), Options(solver), stopped=stopped, save=saved.append)
    assert first.status == "interrupted"
    assert first.steps < complete.steps
    assert first.output_times == first.steps + 1
    monkeypatch.setattr(msahl.run.loop, "CHUNK_SECONDS", 0.1)
    rest, gone_on = advance(violent(), Options(solver), since=saved[-1])
    assert rest.status == "completed"
    for part, other, all_rows in zip(begun, gone_on, rows, strict=True):
        assert np.concatenate([part, other]).tobytes() == all_rows.tobytes()


@pytest.mark.parametrize("degree", [0, 3])
@pytest.mark.parametrize("solver", ["newton", "root"])
def test_every_part_of_a_step_counts_as_work(monkeypatch, solver, degree):
    """A step that takes 256 parts: at most so much work goes by before somebody asks."""
    asked, parts = [], []
    monkeypatch.setattr(outcome, "ASKED_AFTER", 300_000)
    given = {"scheme": "gauss", "degree": degree} if degree else {}
    integrator = SubsystemIntegrator(violent(**given), solver, False, 4)
    stepper = integrator.stepper
    stepper.requests.stopped = lambda: asked.append(len(parts)) or len(asked) == 3
    method = type(stepper.method)

    def result(h):
        return outcome.Outcome(1.0 if h > 0.15 / 256 else 0.0, 0)

    if solver == "newton":

        def take(h, share):
            parts.append(h)
            return result(h)

        monkeypatch.setattr(method, "take_step", lambda self, h, share: take(h, share))
    else:

        def take_by_root(self, h, share, after):
            for _ in range(50):  # evaluations of a search that leads nowhere
                parts.append(h)
                after(outcome.EVALUATION)
            return outcome.Outcome(1.0, 0)

        monkeypatch.setattr(method, "take_step_by_scipy", take_by_root)
    with pytest.raises(outcome.Stopped):
        stepper._subdivide(0.15, 1.0)
    most = 300_000 // outcome.EVALUATION + 1
    assert len(asked) == 3
    assert max(np.diff([0, *asked])) <= most


def test_refused_steps_count_in_a_chunk():
    """From a first size far too large, one chunk is not the search for the right one and all
    steps after it.
    """
    given = {"scheme": "gauss", "degree": 2, "tolerance": 1e-12, "t_final": 1.0, "dt": 0.5}
    model = replace(pendulum(), simulation=replace(pendulum().simulation, **given))
    integrator = SubsystemIntegrator(model, "auto", False, 64)
    integrator.show_start()
    counts, before, most = integrator.stepper.control.counts, 0, 8
    for _ in range(6):
        done = integrator.advance(Chunk(most, times=np.array([1.0]))).steps
        tried = int(counts[step_control.ACCEPTED] + counts[step_control.REFUSED])
        assert done == 2 or tried - before <= most // 2
        assert done >= 2
        before = tried
    assert counts[step_control.REFUSED] > 2


# Where no loop of steps is under way -------------------------------------------------------------


def busy(seconds=20.0):
    """Work in Python that asks nobody; so long only if nothing stops it."""
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        pass


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_request_that_nobody_asks_for_stops_all_the_same(monkeypatch, number):
    monkeypatch.setattr(msahl.cli.interruption, "GRACE", 0.01)
    with stoppable() as stopped:
        os.kill(os.getpid(), number)
        with pytest.raises(KeyboardInterrupt):
            busy()
    assert stopped.signal == number


def test_a_request_that_was_answered_stops_nothing_else(monkeypatch):
    monkeypatch.setattr(msahl.cli.interruption, "GRACE", 0.01)
    with stoppable() as stopped:
        os.kill(os.getpid(), signal.SIGTERM)
        assert stopped()
        busy(0.05)
    os_default = signal.getsignal(signal.SIGALRM)
    assert os_default in (signal.SIG_DFL, signal.default_int_handler, None, signal.SIG_IGN)


@pytest.mark.parametrize(
    "where",
    [
        "msahl.run.record._energy_scale",
        "msahl.run.subsystem.build_at_start",
        "msahl.run.loop.digest",
    ],
)
def test_preparation_answers(tmp_path, monkeypatch, where):
    """Before there is a step there is nothing to keep: it stops, and the folder says so."""
    monkeypatch.setattr(msahl.cli.interruption, "GRACE", 0.01)

    def prepare(*_, **__):
        os.kill(os.getpid(), signal.SIGTERM)
        busy()

    monkeypatch.setattr(where, prepare)
    words = ["run", str(SINGLE), "--t-final", "0.1", "-o", str(tmp_path)]
    result = CliRunner().invoke(main, words)
    assert result.exit_code == 128 + signal.SIGTERM
    assert "stopped before the first step" in result.stderr
    assert json.loads((tmp_path / "run.json").read_text())["status"] == "interrupted"
