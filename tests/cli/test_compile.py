"""The command ``msahl compile``: what it compiles is what runs, reports and studies need."""

import io
import subprocess
import sys

import pytest
from click.testing import CliRunner

from msahl import terminal
from msahl.cli import kernels
from msahl.cli.main import main
from msahl.deck import read_deck
from msahl.jit import by_size, compiled
from msahl.jit.announced import announced
from msahl.jit.progress import CompileError, Progress
from msahl.linalg.symbolic import _merge
from msahl.model import Options
from msahl.resources import example_deck, example_decks
from tests.support.models import simulate

DECK = example_deck("joints/spherical.xml")


def call(*words):
    return CliRunner().invoke(main, ["compile", *map(str, words)])


def test_a_deck_is_compiled_in_advance():
    call(DECK, "--solver", "newton")  # which says that it compiles, if it does
    result = call(DECK, "--solver", "newton")
    assert (result.exit_code, result.stderr) == (0, f"{DECK}: compiled\n")
    assert compiled.on_disk(kernels.calls_of_run(read_deck(DECK), Options(solver="newton")))


DIGEST = """
from contextlib import nullcontext
from msahl.jit.by_size import compiled_at_any_size
from msahl.jit.reach import resolve, source_digest
with {}():
    print(source_digest(resolve("msahl.schemes.collocation.dense_output", "fit")))
"""


def test_what_is_compiled_for_all_is_found_by_runs():
    """Machine code is kept by the constants of its sources, as each process finds them."""
    found = [
        subprocess.check_output([sys.executable, "-c", DIGEST.format(context)], text=True)
        for context in ("nullcontext", "compiled_at_any_size")
    ]
    assert found[0] == found[1]


def test_something_must_be_asked_for():
    result = call()
    assert result.exit_code == 2
    assert "give at least one DECK, or --all" in result.stderr


def test_a_failure_is_reported_in_one_line(monkeypatch):
    def fail(*_):
        raise CompileError("no compiler")

    monkeypatch.setattr(compiled, "prepare", fail)
    result = call(DECK)
    assert (result.exit_code, result.stderr) == (2, "msahl compile: no compiler\n")


def test_everything_includes_large_models_reports_and_studies(monkeypatch):
    """With one deck instead of all; nothing is left changed."""
    prepared, called = [], []
    monkeypatch.setattr(kernels, "example_decks", lambda: [DECK])
    monkeypatch.setattr(kernels, "prepare", lambda calls: prepared.append(list(calls)))
    monkeypatch.setattr(kernels, "call", lambda command, *words: called.append(words))
    told = []
    kernels.compile_everything(told.append)
    assert by_size.by_size(_merge, 1) is _merge
    assert len(prepared[0]) > len(kernels.VARIANTS)
    assert len(told) == 2
    words = {word for words in called for word in words}
    assert {"run", "study", "energy", "constraints"} <= words


def test_what_a_command_announces_outlasts_its_runs(capsys):
    """A study makes many runs, and the first may find everything compiled."""
    with announced(True):
        tell = compiled.STOPWATCH.tell
        simulate(read_deck(DECK), dt=0.01, t_final=0.01)
        assert compiled.STOPWATCH.tell is tell
        tell()
        tell()
    assert compiled.STOPWATCH.tell is not tell
    assert capsys.readouterr().err.count("compiling kernels") == 1


def test_there_are_decks_of_both_kinds():
    systems = [
        kernels.calls_of_run(read_deck(example_deck(d)), Options())[0] for d in kernels.TYPICAL
    ]
    assert [workspace[0].system.scalar is None for _, workspace in systems] == [True, False]
    assert len(example_decks()) > 30


@pytest.mark.parametrize(
    ("names", "end"), [(("equations.residual",), "\r"), ((), "\n")], ids=["working", "done"]
)
def test_the_progress_is_one_line(monkeypatch, names, end):
    terminal = io.StringIO()
    monkeypatch.setattr(terminal, "isatty", lambda: True)
    monkeypatch.setattr("sys.stderr", terminal)
    with announced(True):
        compiled.STOPWATCH.listen(Progress(3, 8, names, 12.4))
    shown = terminal.getvalue()
    assert shown.startswith("\r  3 of 8 parts, about 12 s left")
    assert shown.endswith(end)
    assert len(shown.strip("\r\n")) == 78


def test_every_compilation_has_lines_in_a_pipe(monkeypatch, capsys):
    """One that takes 50 s says so after 20 s and after 40 s, and at its end; the next again."""
    now = 0.0
    monkeypatch.setattr("time.monotonic", lambda: now)
    with announced(True):
        for _ in range(2):
            compiled.STOPWATCH.tell()
            for done in range(5):
                compiled.STOPWATCH.listen(Progress(done, 5, ("equations.residual",), 50.0))
                now += 10.0
            compiled.STOPWATCH.listen(Progress(5, 5, (), 0.0))
    first, *lines = capsys.readouterr().err.splitlines()
    assert "compiling kernels" in first
    assert lines == 2 * [
        "  compiled 2 of 5 parts, about 50 s left",
        "  compiled 4 of 5 parts, about 50 s left",
        "  compiled 5 parts in 50 s",
    ]


def test_a_long_run_has_lines_in_a_pipe(monkeypatch, tmp_path):
    monkeypatch.setattr(terminal, "FIRST", 0.0)
    words = ["run", str(DECK), "--error", "off", "--dt", "0.01", "--t-final", "0.02"]
    result = CliRunner().invoke(main, [*words, "-o", str(tmp_path / "run")])
    assert result.exit_code == 0, result.output
    assert f"  {DECK}: t = 0.02 of 0.02 s" in result.stderr
    quiet = CliRunner().invoke(main, [*words, "-q", "-o", str(tmp_path / "quiet")])
    assert "t = " not in quiet.stderr


def test_hours_have_few_lines():
    now, told = 0.0, []
    lines = terminal.SparseLines(told.append, lambda: now)
    while now < 7200.0:
        now += 1.0
        lines.show(now / 7200.0, "half")
    assert told[0] == "  half, about 7180 s left"
    assert len(told) < 18
