"""Whatever the deck: faults in words or numbers that are numbers, and never a traceback.

``make test`` draws the same few examples every time, ``make fuzz`` new ones for as long as it is
asked to.
"""

import csv
import json
import math
import os
import tempfile
import time
from collections import Counter
from dataclasses import fields, is_dataclass
from pathlib import Path

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from lxml import etree

from msahl.cli.main import main
from msahl.contact.events import WORDS
from msahl.deck import DeckError, read_deck
from msahl.deck.diagnosis import add_faults
from msahl.deck.faults import Faults
from msahl.deck.parse import parse
from msahl.deck.schema import built, objection, schema_bytes
from msahl.post.cli import main as post
from msahl.run.tables import EVENTS
from tests.fuzz.guard import call, guarded
from tests.fuzz.strategies import NUMBERS, files, gentle_mutants, models, mutants, trees
from tests.support.models import ROOT

SECONDS = float(os.environ.get("MSAHL_FUZZ_SECONDS", "0"))
ROUND = 100
"""Examples between two looks at the clock."""
STEPS = 4
TO_CONTACT = 60
"""Steps after which most decks of contacts have had one."""
MOST_STEPS = 1000
"""Of a run with options drawn: what asks for more is omitted, for it is only slow."""


def over(strategy, examples, share):
    """The test that a property holds over ``examples`` of the strategy, always the same; or, for a
    ``share`` of the seconds asked for, over new ones. The property says how each ended.
    """

    def test_of(check):
        def draw(**how):
            quiet = settings(deadline=None, suppress_health_check=list(HealthCheck), **how)
            quiet(given(strategy)(count))()

        def count(example):
            ends[check(example)] += 1

        def test():
            if not SECONDS:
                draw(max_examples=examples)
                return
            end = time.monotonic() + share * SECONDS
            while time.monotonic() < end:
                draw(max_examples=ROUND, derandomize=False)
            told = ", ".join(f"{number} {what}" for what, number in sorted(ends.items()))
            print(f"\n{check.__name__}: {ends.total()} examples: {told}")

        ends = Counter()
        test.__name__, test.__doc__ = check.__name__, check.__doc__
        return test

    return test_of


class Example:
    """A deck in a folder of its own; a context in which it is held to its bounds."""

    def __init__(self, data: bytes) -> None:
        self.data = data

    def __enter__(self) -> "Example":
        self._temporary = tempfile.TemporaryDirectory()
        self.folder = Path(self._temporary.name)
        self.deck = self.folder / "deck.xml"
        self.deck.write_bytes(self.data)
        self._guard = guarded(self.folder)
        self._guard.__enter__()
        return self

    def __exit__(self, *error) -> None:
        try:
            self._guard.__exit__(*error)
        finally:
            self._temporary.cleanup()

    def model(self, changes=()):
        """The model, or None with every fault told as it should be."""
        try:
            return read_deck(self.deck, settings=changes)
        except DeckError as error:
            faults = error.faults
        assert faults
        for fault in faults:
            assert str(fault).startswith(f"{self.folder}/")
            assert fault.line >= 0
            assert fault.message
        return None

    def rows_are_numbers(self, run: Path) -> None:
        """Every cell of every table is a finite number, but for the words of events, in rows of one
        length.
        """
        for table in run.glob("*.csv*"):
            header, *rows = csv.reader(table.read_text().splitlines())
            words = WORDS if table.name.startswith(EVENTS) else ()
            for row in rows:
                pairs = dict(zip(header, row, strict=True))
                cells = [float(cell) for name, cell in pairs.items() if name not in words]
                assert all(map(math.isfinite, cells)), (table, row)


def numbers_of(thing):
    """All numbers in a record."""
    if isinstance(thing, float):
        yield thing
    elif isinstance(thing, tuple):
        for part in thing:
            yield from numbers_of(part)
    elif is_dataclass(thing):
        for field in fields(thing):
            yield from numbers_of(getattr(thing, field.name))


def is_judged(data) -> str:
    """``check`` and ``run`` read the deck alike; ``check`` alone looks for the files of meshes, and
    the folder of the example has none.
    """
    with Example(data) as example:
        told = call(main, "check", example.deck)
        model = example.model()
        good = model is not None and not any(shape.file for shape in model.shapes)
        assert told.exit_code == (0 if good else 2)
        if model is not None:
            assert not any(map(math.isinf, numbers_of(model)))
        return "refused" if model is None else "good"


@over(st.one_of(mutants(), gentle_mutants(), trees()), 100, 0.1)
def test_the_readers_of_the_schema_agree(data):
    """libxml2 as it parses, libxml2 on the tree in memory, xmlschema, and our diagnosis by it."""
    faults = Faults("deck")
    try:
        root = parse(data, faults)
    except DeckError:
        return "no deck"
    schema, judged = schema_bytes(), Faults("deck")
    add_faults(root, built(schema).elements["data"], judged)
    valid = etree.XMLSchema(etree.fromstring(schema)).validate(root.getroottree())
    assert valid == (objection(root, schema) == "") == judged.sound(root)
    if "".join(root.xpath("//text() | //@*")).isascii():
        # Beyond ASCII xmlschema takes for spaces and digits what is neither to XML.
        assert valid == built(schema).is_valid(root)
    return "valid" if valid else "not valid"


@over(mutants(), 100, 0.2)
def test_a_mutant_is_good_or_told_why_not(data):
    return is_judged(data)


@over(trees(), 30, 0.1)
def test_a_tree_of_words_is_reported_why_it_is_no_deck(data):
    return is_judged(data)


@over(files(), 60, 0.15)
def test_bytes_are_reported_why_they_are_no_deck(data):
    return is_judged(data)


def is_run(data, options, pictures, steps=STEPS) -> str:
    """``explain``, ``run`` for a few ``steps``, and the reports on it."""
    with Example(data) as example:
        model = example.model()
        if model is None:
            return "refused"
        explained = call(main, "explain", example.deck)
        end = min(steps * model.simulation.dt, 1e100)
        run = example.folder / "run"
        ran = call(main, "run", example.deck, "-o", run, "--t-final", end, *options)
        # Large steps of a changed deck may be so wrong that the verdict says it.
        assert ran.exit_code in (0, 2, 3) or "FAIL: " in ran.output
        if ran.exit_code:
            assert str(example.deck) in ran.stderr
        if ran.exit_code == 2:  # no start, and nothing was written: explain says so, too
            assert explained.exit_code == 2 or "numbers of" in ran.stderr, ran.stderr
            return "no start"
        assert explained.exit_code == 0, explained.stderr
        example.rows_are_numbers(run)
        assert json.loads((run / "run.json").read_text())["status"] in (
            "completed",
            "not converged",
        )
        for command in ("energy", "constraints", "work"):
            assert call(post, command, run).exit_code == 0
        if model.joints:
            assert call(post, "reactions", run).exit_code == 0
        if pictures:
            assert call(post, "report", run).exit_code == 0
        return "stopped" if ran.exit_code else "ran"


ways = st.tuples(
    st.sampled_from(
        [("--solver", "newton"), ("--solver", "newton", "--full"), ("--solver", "root"), ()]
    ),
    st.sampled_from([True, *[False] * 7]),
)


@over(st.tuples(gentle_mutants(), ways), 25, 0.15)
def test_a_deck_with_other_numbers_runs_or_says_why_not(example):
    data, (options, pictures) = example
    return is_run(data, options, pictures)


@over(st.tuples(models(), ways), 40, 0.2)
def test_a_model_of_extreme_numbers_runs_or_says_why_not(example):
    data, (options, pictures) = example
    return is_run(data, options, pictures)


schemes = st.sampled_from(["preserving", "decaying", "gauss2", "gauss3", "radau2", "auto"])


@over(st.tuples(gentle_mutants(folder="contact"), schemes), 12, 0.1)
def test_a_deck_with_contacts_and_other_numbers_runs_or_says_why_not(example):
    """Without an end of events, too: their number at one time and in one step is bounded."""
    data, scheme = example
    return is_run(data, ("--scheme", scheme), False, TO_CONTACT)


SINGLE = ROOT / "decks" / "thesis" / "single_pendulum_45.xml"
texts = st.sampled_from(
    [*(n for n in NUMBERS if len(n) < 1000), "1e-3", "0.1", "10", "1000000000000000000000"]
)
given_options = st.dictionaries(
    st.sampled_from(["--dt", "--t-final", "--every", "--damping", "--scheme", "--solver"]),
    texts,
    max_size=3,
)


@over(given_options, 40, 0.1)
def test_options_are_taken_or_refused(given):
    steps = _number(given.get("--t-final", "10")) / (
        _number(given.get("--dt", "0.002")) or math.nan
    )
    if MOST_STEPS < steps <= 1e9:
        return "omitted"
    words = [f"{name}={text}" for name, text in given.items()]
    with Example(SINGLE.read_bytes()) as example:
        run = example.folder / "run"
        told = call(main, "run", example.deck, "-o", run, "--t-final=0.01", *words)
        assert told.exit_code in (0, 2, 3)
        assert (told.exit_code == 0) or told.stderr
        example.rows_are_numbers(run)
        return "refused" if told.exit_code == 2 else "ran"


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan
