"""Folders that are not as a run left them: refused in one line, or FAIL; never a traceback."""

import copy
import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import msahl
import msahl.post.metrics
import msahl.post.run_report
import msahl.post.sentences
from msahl.cli.main import main as engine
from msahl.post.cli import main as post
from msahl.post.document import OnPage, as_markdown
from msahl.post.metrics import Energy
from msahl.post.page.parts import NOTHING
from msahl.post.run_report import banner, build_report
from msahl.post.run_verdicts import read_verdict, verdict_table
from msahl.post.table import as_text
from msahl.results.read import ResultError, read_run
from msahl.run.verdict import FAIL, PASS
from tests.support.models import ROOT
from tests.support.run_folders import DT, ROWS, conical_rows, write

INFO = {
    "msahl": "0.1.0",
    "deck": {"path": "cone.xml", "digest": "ab" * 32},
    "options": {
        "dt": DT,
        "tFinal": DT * (ROWS - 1),
        "scheme": "preserving",
        "solver": "auto",
        "every": 1,
        "reactions": "mean",
        "outputInterval": None,
        "tolerance": None,
    },
    "status": "completed",
    "message": "",
    "outputTimes": ROWS,
    "steps": ROWS - 1,
    "time": DT * (ROWS - 1),
    "joints": 1,
    "subsystems": 1,
    "planarSubsystems": 0,
    "unknowns": 9,
    "degreesOfFreedom": {"byCount": 3, "byRank": 3},
    "checksums": {"work.csv": "0123abcd"},
    "nonUniqueReactions": {"Pivot": ["Fz"]},
    "iterations": 40,
    "pathSteps": 0,
    "subdivisions": 0,
    "warnings": ["a warning"],
    "seconds": {"loop": 0.25},
    "extremes": {
        "energyErrorMaxRelative": 1e-15,
        "constraintViolationMax": 1e-15,
        "localErrorSum": None,
    },
    "error": {"position": 1e-9, "orientation": 1e-9, "trustHorizon": 0.4, "complete": True},
    "verdict": {
        "word": PASS,
        "reasons": ["a reason"],
        "checks": {"end": {"word": PASS, "text": "40 steps"}},
    },
}
"""A run.json with every field that is read back."""

DEEP = "[" * 10_000 + "]" * 10_000
VALUES = ("null", "true", "5", "-1", "1e308", "1.5", '"x"', "[]", "[1]", "[[]]", "{}", '{"a": [1]}')
FILES = (
    *VALUES, DEEP, '{"verdict": ' + DEEP + "}", "", "{", '{"outputTimes": 1e999}',
    '{"outputTimes": NaN}',
    '{"outputTimes": ' + "9" * 5000 + "}", '"\ud800"', "\x00", "{}{}",
)  # fmt: skip
COMMANDS = (
    ("energy",), ("work",), ("events", "Bob.x"), ("constraints",), ("verdict",), ("reactions",),
    ("plot", "path"), ("report",), ("compare",),
)  # fmt: skip


def call(command, *words):
    """A command that ends well, or in one line on stderr."""
    result = CliRunner().invoke(command, [str(word) for word in words])
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    if result.exit_code == 2:
        assert result.stderr.count("\n") == 1, result.stderr
    return result


def post_of(folder, name, *more):
    """A command of msahl-post on a run; ``compare`` with itself."""
    return call(post, name, folder, *more, *((folder,) if name == "compare" else ()))


@pytest.fixture
def run(tmp_path):
    write(tmp_path / "run", info=INFO)
    return tmp_path / "run"


@pytest.fixture
def light(monkeypatch):
    """Reports without pictures, which depend on nothing in run.json."""
    monkeypatch.setattr(msahl.post.run_report, "_pictures", lambda run: ([], []))
    monkeypatch.setattr(msahl.post.run_report, "_motion", lambda *_: OnPage(NOTHING))


def places(value, path=()):
    """The keys to every part of a JSON value."""
    if path:
        yield path
    if isinstance(value, dict | list):
        for key in value if isinstance(value, dict) else range(len(value)):
            yield from places(value[key], (*path, key))


def put(info, path, value):
    changed = copy.deepcopy(info)
    holder = changed
    for key in path[:-1]:
        holder = holder[key]
    holder[path[-1]] = value
    return changed


def read_or_refused(folder):
    """The run, or why it is refused."""
    try:
        return read_run(folder)
    except ResultError as error:
        return str(error)


def test_the_folder_itself_is_sound(run):
    assert post_of(run, "verdict").exit_code == 0
    assert read_verdict(run).word == PASS


@pytest.mark.parametrize("name", [command[0] for command in COMMANDS])
@pytest.mark.parametrize("text", ["null", "5", "[1]", '"x"', DEEP])
def test_no_command_takes_a_run_json_that_is_no_object(run, name, text):
    (run / "run.json").write_text(text)
    (command,) = (words for words in COMMANDS if words[0] == name)
    result = post_of(run, *command[:1], *command[1:])
    assert result.exit_code == 2
    assert f"{run / 'run.json'}: " in result.stderr
    assert "run the deck again: msahl run" in result.stderr


@pytest.mark.parametrize("text", FILES, ids=lambda text: text[:12])
def test_whatever_a_run_json_holds_it_is_refused_or_read(run, text, light):
    (run / "run.json").write_text(text, errors="surrogatepass")
    for name in ("energy", "verdict", "report"):
        result = post_of(run, name)
        # An object without known fields says as little as no file: the tables may be complete.
        empty = text in ("{}", '{"a": [1]}')
        assert result.exit_code == (2 if not empty or "no verdict" in result.stderr else
                                    1 if name == "verdict" else 0)  # fmt: skip


@pytest.mark.slow
def test_every_field_may_hold_any_json_value(run, light):
    # One set of metrics does for all: of run.json they depend on the non-unique reactions alone.
    sound = read_run(run)
    measured = msahl.post.metrics.compute_metrics(sound)
    refused = 0
    for path in places(INFO):
        for text in VALUES:
            (run / "run.json").write_text(json.dumps(put(INFO, path, json.loads(text))))
            read = read_or_refused(run)
            if isinstance(read, str):
                refused += 1
                assert read.startswith(f"{run}/")
                assert "\n" not in read
                continue
            build_report(read, measured)
            msahl.post.metrics._reactions(read)
            assert as_text(verdict_table([read_verdict(run)]))
    # Most values are of the wrong type for their field.
    assert refused > 0.6 * len(VALUES) * len(list(places(INFO)))


def test_a_report_and_its_verdict_of_each_field_alone(run, light):
    """What is omitted of run.json is not needed, and its parts are."""
    for path in places(INFO):
        if isinstance(path[-1], int):
            continue
        less = copy.deepcopy(INFO)
        holder = less
        for key in path[:-1]:
            holder = holder[key]
        del holder[path[-1]]
        (run / "run.json").write_text(json.dumps(less))
        read = read_or_refused(run)
        if isinstance(read, str):
            assert path[0] == "verdict"
            continue
        for part in ("_line", "banner", "_accuracy", "_facts"):
            getattr(msahl.post.run_report, part)(read)


def edited(name, change):
    """A change of a table's cells, the header's first."""

    def edit(folder):
        path = folder / name
        cells = [line.split(",") for line in path.read_text().splitlines()]
        path.write_text("".join(",".join(row) + "\n" for row in change(cells)))

    return edit


def cell(row, column, text):
    """Another text in one cell."""

    def change(cells):
        cells[row][column] = text
        return cells

    return change


def rows(choose):
    """Other rows below the header."""
    return lambda cells: [cells[0], *choose(cells[1:])]


def times(choose):
    """Other times, by those there are."""

    def change(cells):
        other = choose([row[0] for row in cells[1:]])
        new = [[time, *row[1:]] for time, row in zip(other, cells[1:], strict=True)]
        return [cells[0], *new]

    return change


BOTH = ("states.csv", "reactions.csv")
STATES, REACTIONS = BOTH[:1], BOTH[1:]
SAYS = "but run.json says 41"
DAMAGE = {
    "nan": (STATES, cell(5, 1, "nan"), ":6: Bob.x is nan"),
    "inf": (REACTIONS, cell(5, 2, "-inf"), ":6: Pivot.Fy is -inf"),
    "nan time": (STATES, cell(9, 0, "nan"), ":10: time is nan"),
    "text": (STATES, cell(5, 1, "x"), ":6: 'x' is not a number"),
    "nothing": (STATES, cell(5, 1, ""), ":6: '' is not a number"),
    "comment": (STATES, cell(4, 0, "# 0.03"), ":5: '# 0.03' is not a number"),
    "rows reversed": (STATES, rows(lambda r: r[::-1]), ":3: time 0.39 s follows 0.4 s"),
    "times reversed": (STATES, times(lambda t: t[::-1]), ":3: time 0.39 s follows 0.4 s"),
    "duplicate time": (STATES, cell(7, 0, "0.05"), ":8: time 0.05 s follows 0.05 s"),
    "other time": (REACTIONS, cell(7, 0, "0.061"), ":8: time 0.061 s, where states.csv has 0.06"),
    "later start": (BOTH, cell(1, 0, "0.001"), ":2: the first row is at 0.001 s, not at 0"),
    "early end": (BOTH, cell(41, 0, "0.395"), ":42: the last row is at 0.395 s; run.json says 0.4"),
    "shorter": (BOTH, rows(lambda r: r[:-3]), f"38 rows, {SAYS}"),
    "one row less": (STATES, rows(lambda r: r[:8] + r[9:]), f"40 rows, {SAYS}"),
    "one row more": (BOTH, rows(lambda r: [*r, r[-1]]), f"42 rows, {SAYS}"),
    "no rows": (BOTH, rows(lambda r: []), f"0 rows, {SAYS}"),
    "one cell less": (STATES, rows(lambda r: [r[0][:-1], *r[1:]]), ":2: 12 numbers under 13 col"),
    "no last column": (STATES, lambda cells: [row[:-1] for row in cells], "Bob.wz is missing"),
    "shorter head": (STATES, lambda c: [c[0][:-1], *c[1:]], ":2: 13 numbers under 12 columns"),
    "no time": (STATES, lambda cells: [row[1:] for row in cells], "time is missing"),
    "column twice": (STATES, cell(0, 2, "Bob.x"), ":1: a column appears twice"),
    "other column": (STATES, cell(0, 2, "Bub.x"), "Bob.y is missing"),
    "empty": (STATES, lambda cells: [], "time is missing"),
}


@pytest.mark.parametrize(("tables", "change", "told"), DAMAGE.values(), ids=DAMAGE)
def test_a_changed_table_is_refused_and_its_verdict_is_fail(run, tables, change, told):
    for table in tables:
        edited(table, change)(run)
    for command in COMMANDS[:4]:
        result = post_of(run, *command[:1], *command[1:])
        assert result.exit_code == 2
        assert told in result.stderr
        assert "run the deck again: msahl run" in result.stderr
    judged = read_verdict(run)
    assert judged.word == FAIL
    assert told in judged.reasons[0]
    assert post_of(run, "verdict").exit_code == 1


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """A pendulum as ``msahl run`` left it."""
    folder = tmp_path_factory.mktemp("finished") / "run"
    deck = ROOT / "decks/thesis/single_pendulum_45.xml"
    assert call(engine, "run", deck, "--t-final", "0.1", "-q", "-o", folder).exit_code == 0
    return folder


@pytest.fixture
def kept(finished, tmp_path):
    return Path(shutil.copytree(finished, tmp_path / "run"))


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("states.csv", cell(5, 1, "0.125")),
        ("reactions.csv", cell(-1, -1, "0.125")),
        ("error.csv", cell(2, 1, "0.125")),
        ("deck.xml", lambda lines: [*lines, ["<!-- later -->"]]),
    ],
)
def test_what_was_altered_after_the_run_is_no_pass(kept, name, change):
    """A table that can be read, with a number that the run did not write."""
    assert read_verdict(kept).word == msahl.read(kept).verdict == PASS
    edited(name, change)(kept)
    told = f"{kept / name} was altered after the run; run the deck again: msahl run"
    judged = read_verdict(kept)
    assert judged.word == FAIL
    assert judged.reasons[0] == told
    assert post_of(kept, "verdict").exit_code == 1
    result = msahl.read(kept)
    assert result.verdict == FAIL
    assert result.reasons[0] == told
    report = as_markdown(banner(read_run(kept)))
    assert "FAIL" in report
    assert told in report


def test_all_files_that_were_altered_are_named(kept):
    for name in ("states.csv", "error.csv"):
        edited(name, cell(2, 1, "0.125"))(kept)
    assert f"{kept / 'states.csv'}, {kept / 'error.csv'} were altered" in "; ".join(
        read_verdict(kept).reasons
    )


@pytest.mark.parametrize("case", ["rows reversed", "duplicate time", "shorter", "column twice"])
def test_compare_refuses_tables_without_order(run, tmp_path, case):
    _, change, told = DAMAGE[case]
    write(tmp_path / "other", info=INFO)
    edited("states.csv", change)(run)
    for pair in ((run, tmp_path / "other"), (tmp_path / "other", run)):
        result = call(post, "compare", *pair)
        assert result.exit_code == 2
        assert told in result.stderr


def test_without_run_json_complete_tables_have_as_many_rows_as_each_other(run):
    (run / "run.json").unlink()
    assert len(read_run(run).time) == ROWS
    edited("reactions.csv", rows(lambda r: r[:-1]))(run)
    with pytest.raises(ResultError, match=f"40 rows, but states.csv has {ROWS}"):
        read_run(run)


def test_energies_that_are_no_numbers_are_not_round_off():
    assert "rounding error" not in msahl.post.sentences.describe_energy(spoilt_energy())


def spoilt_energy():
    states, _ = conical_rows()
    kinetic = np.ones((len(states), 1))
    potential = np.full((len(states), 1), np.nan)
    work = np.zeros(len(states))
    return Energy(states[:, 0], ("Bob",), kinetic, 0.0 * kinetic, potential, work, work)


RESUMED = (
    "null", "5", "[1]", '"x"', DEEP, "{", '{"status": 5}', '{"status": "completed"}',
    '{"status": "completed", "options": 5}', '{"status": "completed", "options": {}}',
)  # fmt: skip


@pytest.mark.parametrize("text", RESUMED, ids=lambda text: text[:30])
def test_resume_over_a_damaged_run_json_is_refused(run, text):
    (run / "run.json").write_text(text)
    result = call(engine, "run", run / "source.xml", "-o", run, "--resume")
    assert result.exit_code == 2
    assert "omit --resume to start again" in result.stderr
