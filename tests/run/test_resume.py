"""Runs that stop and go on: the rows are those of the run that did not stop, bit for bit."""

import json
import os
import random
import shlex
import signal
import subprocess
import sys
import time
from dataclasses import replace

import pytest
from click.testing import CliRunner

import msahl.run.loop
from msahl.cli.main import main
from msahl.deck import read_deck
from msahl.model import Options
from msahl.model.scheme import EXPLICIT
from msahl.results.checkpoint import _checksum
from msahl.run import companion
from msahl.run.snapshot import ResumeError
from msahl.run.tables import TABLES
from tests.support.models import DECKS, ROOT, body, build_model, deck, pendulum, run_in_memory
from tests.system.test_nonfinite import push

THESIS = ROOT / "decks" / "thesis"
DOUBLE = THESIS / "double_pendulum_89.xml"

VARIANTS = [
    {"scheme": scheme, "reactions": reactions}
    for scheme in ("preserving", "decaying")
    for reactions in ("mean", "instantaneous")
]
COUNTED = (
    "output_times",
    "steps",
    "time",
    "iterations",
    "factorisations",
    "scipy_steps",
    "path_steps",
    "subdivisions",
)


def advance(model, options, **others):
    """Report and tables of a run, also of a model whose loads are absurd."""
    report, sink = run_in_memory(model, options, checked=True, **others)
    return report, [sink.table(name) for name in TABLES]


def stop_after(chunks):
    """A request to stop at the end of this chunk, and whether it was asked for."""
    asked = iter(range(1, chunks + 1))
    return lambda: next(asked) == chunks


def in_two_parts(monkeypatch, model, options, steps, each=1):
    """Reports and rows of a run stopped after ``steps``, chunks of ``each``, and of the rest."""
    saved, done = [], [0]
    with monkeypatch.context() as patch:
        patch.setattr(msahl.run.loop, "CHUNK_SECONDS", 0.0)
        stop = {
            "progress": lambda steps, t: done.append(steps),
            "stopped": lambda: done[-1] >= steps,
        }
        parts = [advance(model, options, save=saved.append, **stop)]
    assert (parts[0][0].status, parts[0][0].steps) == ("interrupted", steps)
    parts.append(advance(model, options, save=saved.append, since=saved[-1]))
    return parts


def bits(*runs):
    """Every table's rows, those of all ``runs`` one after the other."""
    return [
        b"".join(part.tobytes() for rows in runs for part in rows[k]) for k in range(len(TABLES))
    ]


def same_run(monkeypatch, model, options, steps):
    """Hold a run in two parts to the one that does not stop; the report of that one."""
    complete, rows = advance(model, options)
    (_, first), (rest, second) = in_two_parts(monkeypatch, model, options, steps)
    assert bits(first, second) == bits(rows)
    assert [getattr(rest, key) for key in COUNTED] == [getattr(complete, key) for key in COUNTED]
    assert rest.resumed == [pytest.approx(steps * model.simulation.dt, rel=1e-12)]
    # Sums are taken chunk by chunk, so their last digits are of the chunks.
    for key, value in complete.extremes.items():
        summed = value is not None and key in ("energyErrorRms", "localErrorSum")
        expected = pytest.approx(value, rel=1e-12) if summed else value
        assert rest.extremes[key] == expected
    assert (rest.error, rest.verdict["word"]) == (complete.error, complete.verdict["word"])
    return complete


@pytest.mark.sampled
@pytest.mark.parametrize("path", DECKS, ids=lambda path: path.stem)
def test_every_deck_goes_on_bit_for_bit(monkeypatch, path):
    """Thinned rows and a last step of its own size; schemes and reactions alternate."""
    model, variant = read_deck(path), VARIANTS[DECKS.index(path) % len(VARIANTS)]
    t_final = 50.5 * model.simulation.dt
    model = replace(model, simulation=replace(model.simulation, t_final=t_final, **variant))
    same_run(monkeypatch, model, Options(every=3), 20)


HIGHER_ORDER_DECKS = (
    "triple_pendulum_45", "spring_damper", "friction_hinge", "joint_motion_table", "bricard",
    "two_pendulums", "knife_edge",
)  # fmt: skip


@pytest.mark.parametrize("name", HIGHER_ORDER_DECKS)
@pytest.mark.parametrize("options", [Options("root"), Options("newton", full=True)], ids=str)
def test_every_solver_goes_on_bit_for_bit(monkeypatch, name, options):
    model = deck(name)
    simulation = replace(model.simulation, t_final=24 * model.simulation.dt, scheme="decaying")
    same_run(monkeypatch, replace(model, simulation=simulation), options, 9)


@pytest.mark.parametrize("steps", [1, 50, 99])
def test_a_run_of_violent_steps_goes_on_bit_for_bit(monkeypatch, steps):
    model = deck("triple_pendulum_135")
    model = replace(model, simulation=replace(model.simulation, dt=0.5, t_final=50.0))
    assert same_run(monkeypatch, model, Options(), steps).path_steps >= 5


@pytest.mark.parametrize("scheme", ["gauss", "radau"])
@pytest.mark.parametrize("name", ["triple_pendulum_45", "friction_hinge", "flyball_governor"])
def test_steps_of_higher_degree_go_on_bit_for_bit(monkeypatch, name, scheme):
    model = deck(name)
    simulation = replace(
        model.simulation, t_final=24 * model.simulation.dt, scheme=scheme, degree=2
    )
    same_run(monkeypatch, replace(model, simulation=simulation), Options(accuracy=1e-6), 9)


@pytest.mark.parametrize("scheme", EXPLICIT)
@pytest.mark.parametrize("name", ["triple_pendulum_45", "suspension", "motor_four_bar"])
def test_explicit_steps_go_on_bit_for_bit(monkeypatch, name, scheme):
    """Of a tree, of loops, and of auxiliary states."""
    model = deck(name)
    simulation = replace(model.simulation, t_final=24 * model.simulation.dt, scheme=scheme)
    same_run(monkeypatch, replace(model, simulation=simulation), Options(accuracy=1e-6), 9)


@pytest.mark.parametrize("name", ["triple_pendulum_45", "friction_hinge"])
def test_output_between_steps_goes_on_bit_for_bit(monkeypatch, name):
    """Where they stand in their steps does not depend on where chunks begin."""
    model = deck(name)
    dt = model.simulation.dt
    given = {"scheme": "gauss", "degree": 2, "t_final": 24 * dt, "output_interval": 0.37 * dt}
    model = replace(model, simulation=replace(model.simulation, **given))
    same_run(monkeypatch, model, Options(accuracy=1e-6), 9)


@pytest.mark.slow
def test_the_run_at_half_the_step_goes_on_too(monkeypatch):
    model = deck("two_pendulums")
    model = replace(model, simulation=replace(model.simulation, t_final=10.0))
    # Stopped before and after the two come to part, it is the same time that is found.
    for steps in (150, 1500):
        error = same_run(monkeypatch, model, Options(accuracy=1e-3), steps).error
        assert 0.75 < error["trustHorizon"] < 7.5


@pytest.mark.slow
def test_a_step_that_failed_fails_again(monkeypatch):
    """A load of (10 t)^400 N: nothing to see before 0.1 s, beyond all numbers after 0.6 s."""
    sudden = push(1e200, *[0.0] * 400, 1e200)
    model = build_model([body(velocity=(1.0, 0.0, 0.0))], loads=[sudden], dt=0.01, t_final=1.0)
    complete, rows = advance(model, Options())
    assert complete.status == "not converged"
    assert complete.steps > 3
    (_, first), (rest, second) = in_two_parts(monkeypatch, model, Options(), 3)
    assert (rest.status, rest.steps, rest.message) == (
        complete.status,
        complete.steps,
        complete.message,
    )
    assert bits(first, second) == bits(rows)


def test_a_snapshot_of_another_model_is_refused(monkeypatch):
    saved = []
    monkeypatch.setattr(msahl.run.loop, "CHUNK_SECONDS", 0.0)
    advance(pendulum(), Options(), stopped=stop_after(3), save=saved.append)
    heavier = replace(pendulum(), bodies=(replace(pendulum().bodies[0], mass=2.5),))
    with pytest.raises(ResumeError, match="differ in the last digits"):
        advance(heavier, Options(), since=saved[-1])


# The command -------------------------------------------------------------------------------------


def call(*words):
    return CliRunner().invoke(main, ["run", *map(str, words)])


def interrupted(monkeypatch, folder, *words, number=signal.SIGINT, after=4):
    """The run of a deck stopped by a signal after some chunks of a step each."""
    hand_over, chunks = msahl.run.loop.TimeLoop._hand_over, []

    def ask(self, *given):
        hand_over(self, *given)
        chunks.append(given)
        if len(chunks) == after:
            os.kill(os.getpid(), number)

    with monkeypatch.context() as patch:
        patch.setattr(msahl.run.loop, "CHUNK_SECONDS", 0.0)
        patch.setattr(msahl.run.loop.TimeLoop, "_hand_over", ask)
        result = call(*words, "-o", folder)
    assert result.exit_code == 128 + number, result.output
    return result


def tables(folder):
    return {path.name: path.read_bytes() for path in folder.glob("*.csv")}


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_the_message_of_a_stopped_run_is_the_command_that_goes_on(tmp_path, monkeypatch, number):
    words = (DOUBLE, "--dt", "0.01", "--t-final", "0.3", "--every", "2", "--full")
    result = interrupted(monkeypatch, tmp_path / "a b", *words, number=number)
    info = json.loads((tmp_path / "a b" / "run.json").read_text())
    assert info["status"] == "interrupted"
    assert info["message"] in result.stderr
    assert "stopped at t = 0.04 s; resume it with: msahl run " in info["message"]
    again = info["message"].split("resume it with: msahl ")[1]
    assert "--resume" in again
    rest = CliRunner().invoke(main, shlex.split(again))
    assert rest.exit_code == 0, rest.output
    complete = call(*words, "-o", tmp_path / "complete")
    assert complete.exit_code == 0
    assert tables(tmp_path / "a b") == tables(tmp_path / "complete")
    assert not list((tmp_path / "a b").glob("checkpoint*"))
    assert not list((tmp_path / "a b").glob("*.part"))
    told = json.loads((tmp_path / "a b" / "run.json").read_text())
    assert (told["status"], told["resumed"], told["steps"]) == ("completed", [0.04], 30)


def test_the_deck_beside_the_rows_goes_on_too(tmp_path, monkeypatch):
    interrupted(monkeypatch, tmp_path, DOUBLE, "--dt", 0.01, "--t-final", 0.1)
    assert call(tmp_path / "deck.xml", "-o", tmp_path, "--resume").exit_code == 0
    assert json.loads((tmp_path / "run.json").read_text())["status"] == "completed"


def test_a_run_killed_while_its_tables_took_their_names_goes_on(tmp_path, monkeypatch):
    words = (DOUBLE, "--dt", 0.01, "--t-final", 0.1)
    interrupted(monkeypatch, tmp_path / "out", *words)
    (tmp_path / "out" / "states.csv.part").rename(tmp_path / "out" / "states.csv")
    (tmp_path / "out" / "run.json").unlink()
    assert call(*words, "-o", tmp_path / "out", "--resume").exit_code == 0
    assert call(*words, "-o", tmp_path / "complete").exit_code == 0
    assert tables(tmp_path / "out") == tables(tmp_path / "complete")


def test_a_run_that_ends_at_once_makes_no_checkpoint(monkeypatch):
    """Saving is by the clock: none within the first seconds, one a chunk where they may be had."""
    saved = []
    advance(pendulum(), Options(), save=saved.append)
    assert saved == []
    monkeypatch.setattr(msahl.run.loop, "SAVE_SECONDS", 0.0)
    monkeypatch.setattr(msahl.run.loop, "SAVE_SHARE", 1e9)
    monkeypatch.setattr(msahl.run.loop, "CHUNK_SECONDS", 0.0)
    report, _ = advance(pendulum(), Options(), save=saved.append)
    assert len(saved) == report.steps - 1


def test_a_complete_run_has_nothing_to_go_on_with(tmp_path):
    words = (DOUBLE, "--dt", 0.01, "--t-final", 0.1, "-o", tmp_path)
    assert call(*words).exit_code == 0
    before = tables(tmp_path)
    result = call(*words, "--resume")
    assert (result.exit_code, tables(tmp_path)) == (0, before)
    assert "is complete" in result.stderr
    # It ended as told: another end is another run.
    longer = call(*words, "--resume", "--t-final", 0.2)
    assert longer.exit_code == 2
    assert "tFinal was 0.1, is 0.2 now" in longer.stderr
    assert tables(tmp_path) == before


OTHERS = {
    "dt": (("--dt", 0.02), "dt was 0.01, is 0.02 now"),
    "end": (("--t-final", 0.2), "tFinal was 0.1, is 0.2 now"),
    "scheme": (("--scheme", "decaying"), "scheme was preserving, is decaying now"),
    "solver": (("--solver", "newton"), "solver was auto, is newton now"),
    "rows": (("--every", 2), "every was 1, is 2 now"),
    "full": (("--full",), "full was False, is True now"),
    "reactions": (("--reactions", "instantaneous"), "reactions was mean, is instantaneous now"),
}


@pytest.mark.parametrize(("words", "told"), OTHERS.values(), ids=OTHERS)
def test_other_options_are_refused_by_name(tmp_path, monkeypatch, words, told):
    first = (DOUBLE, "--dt", 0.01, "--t-final", 0.1)
    interrupted(monkeypatch, tmp_path, *first)
    kept = {path: path.read_bytes() for path in tmp_path.iterdir()}
    result = call(*first, "-o", tmp_path, *words, "--resume")
    assert result.exit_code == 2
    assert told in result.stderr
    assert "omit --resume" in result.stderr
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == kept


def test_another_deck_is_refused(tmp_path, monkeypatch):
    own = tmp_path / "own.xml"
    own.write_bytes(DOUBLE.read_bytes())
    interrupted(monkeypatch, tmp_path / "out", own)
    own.write_bytes(own.read_bytes() + b"\n")
    result = call(own, "-o", tmp_path / "out", "--resume")
    assert result.exit_code == 2
    assert "own.xml is not the deck with which the run there was " in result.stderr


def _head_with(**changes):
    def change(folder):
        line, _, memory = (folder / "checkpoint").read_bytes().partition(b"\n")
        head = json.loads(line) | changes
        del head["check"]
        head |= {"check": _checksum(head, memory)}
        (folder / "checkpoint").write_bytes(json.dumps(head).encode() + b"\n" + memory)

    return change


def _other_version(folder):
    line = (folder / "checkpoint").read_bytes().partition(b"\n")[0]
    _head_with(about=json.loads(line)["about"] | {"numpy": "0.1"})(folder)


def _flip(folder):
    data = bytearray((folder / "checkpoint").read_bytes())
    data[-5] ^= 1
    (folder / "checkpoint").write_bytes(data)


def _shorten(folder):
    part = folder / "states.csv.part"
    part.write_bytes(part.read_bytes()[:-10])


def _head(text):
    """Another first line, as an editor would leave it."""

    def change(folder):
        memory = (folder / "checkpoint").read_bytes().partition(b"\n")[2]
        (folder / "checkpoint").write_bytes(text.encode() + b"\n" + memory)

    return change


def _edit(**changes):
    def change(folder):
        line = (folder / "checkpoint").read_bytes().partition(b"\n")[0]
        _head(json.dumps(json.loads(line) | changes))(folder)

    return change


SPOILED = {
    "null": (_head("null"), "not a checkpoint"),
    "number": (_head("5"), "not a checkpoint"),
    "list": (_head("[1]"), "not a checkpoint"),
    "deep": (_head("[" * 10_000 + "]" * 10_000), "not a checkpoint"),
    "ends": (_edit(ends=[1]), "damaged"),
    "numbers": (_edit(numbers=None), "damaged"),
    "options": (_edit(about={"options": 5}), "damaged"),
    "no checkpoint": (lambda folder: (folder / "checkpoint").unlink(), "there is no checkpoint"),
    "no JSON": (lambda folder: (folder / "checkpoint").write_bytes(b"x"), "not a checkpoint"),
    "layout": (_head_with(layout=0), "written by another version of msahl"),
    "software": (_other_version, "numpy was 0.1, is "),
    "damage": (_flip, "damaged"),
    "rows": (_shorten, "rows are missing that the run had written"),
}


@pytest.mark.parametrize(("spoil", "told"), SPOILED.values(), ids=SPOILED)
def test_what_cannot_go_on_is_refused_with_a_remedy(tmp_path, monkeypatch, spoil, told):
    interrupted(monkeypatch, tmp_path, DOUBLE)
    spoil(tmp_path)
    result = call(DOUBLE, "-o", tmp_path, "--resume")
    assert result.exit_code == 2
    assert told in result.stderr
    assert "omit --resume to start again" in result.stderr


def test_a_folder_that_is_not_there_is_not_made(tmp_path):
    result = call(DOUBLE, "-o", tmp_path / "none", "--resume")
    assert result.exit_code == 2
    assert "no run to resume; omit --resume" in result.stderr
    assert not (tmp_path / "none").exists()


def test_the_clock_does_not_cut_the_steps_of_a_companion(monkeypatch):
    """A first step by scipy that takes long ends the chunk; it may be one of eight that the
    companion takes in one."""
    monkeypatch.setattr(companion, "CHEAP", 0.0)
    model = deck("triple_pendulum_45")
    model = replace(model, simulation=replace(model.simulation, dt=4e-5, t_final=0.02))
    patient, rows = advance(model, Options(every=17))
    assert patient.error["companion"] == "gauss3 with 8 times the step size"
    monkeypatch.setattr(msahl.run.loop, "PATIENCE", 0.0)
    steps = []
    hasty, others = advance(model, Options(every=17), progress=lambda done, t: steps.append(done))
    assert steps[0] == 8  # and not 1
    assert bits(others) == bits(rows)
    assert hasty.error == patient.error


# Killed ------------------------------------------------------------------------------------------

OFTEN = """
import msahl.run.loop
from msahl.cli.main import main
from msahl.run import loop
loop.CHUNK_SECONDS, loop.SAVE_SECONDS, loop.SAVE_SHARE = 0.005, 0.02, 1.0
main()
"""
"""A run that saves some thirty times a second, so that kills fall before, between and within."""
LONGEST = 0.25
"""Seconds, at most, after its first checkpoint at which a run is killed."""


def _begin(folder, words, until):
    """A process with the run, begun anew or going on, once it has written the file ``until``."""
    more = ["--resume"] if (folder / "checkpoint").exists() else []
    command = [sys.executable, "-c", OFTEN, "run", *map(str, words), "-o", str(folder), *more]
    process = subprocess.Popen(command, stderr=subprocess.PIPE)
    deadline = time.monotonic() + 120  # a cold compilation on a busy machine
    while process.poll() is None and time.monotonic() < deadline:
        said, other = folder / "run.json.part", folder / until
        mine = said.exists() and f'"pid": {process.pid}' in said.read_text()
        if mine and other.exists() and other.stat().st_mtime_ns >= said.stat().st_mtime_ns:
            break
        time.sleep(0.002)
    return process


@pytest.mark.slow
@pytest.mark.parametrize(
    ("number", "t_final"), [(4, 10), pytest.param(10, 18, marks=pytest.mark.slow)]
)
def test_a_run_killed_and_resumed_writes_the_rows_of_one_that_was_not(tmp_path, number, t_final):
    pendulum = THESIS / "triple_pendulum_45.xml"
    words = (pendulum, "--dt", 0.00004, "--t-final", t_final, "--every", 17)
    assert call(*words, "-o", tmp_path / "complete").exit_code == 0
    complete = tables(tmp_path / "complete")
    assert all(len(text) > 100_000 * t_final / 4 for text in complete.values())
    chance, kills, runs, resumed = random.Random(1), 0, 0, 0
    while kills < number or not runs:
        folder = tmp_path / str(runs)
        # Every fifth has not yet come to a checkpoint of its own.
        early = kills % 5 == 0
        resumed += (folder / "checkpoint").exists()
        process = _begin(folder, words, "run.json.part" if early else "checkpoint")
        if kills < number:
            time.sleep(0.0 if early else chance.uniform(0.0, LONGEST))
            process.kill()
        _, told = process.communicate(timeout=300)
        if process.returncode == -signal.SIGKILL:
            kills += 1
            continue
        assert process.returncode == 0, told
        found = tables(folder)
        # Not compared as a whole: a difference of megabytes would take pytest minutes to print.
        assert [name for name in complete if found[name] != complete[name]] == []
        runs += 1
    assert resumed > number // 2
