"""Faults that ``make fuzz`` found, each held to the sentence it ends in now."""

import difflib
import resource
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import pytest
from click.testing import CliRunner
from lxml import etree

import msahl.deck.faults
import msahl.system.subsystems
from msahl.check.faults import MOST_LISTED
from msahl.cli.main import main
from msahl.deck import DeckError, read_deck
from msahl.deck.faults import LONGEST, MOST_KEPT, MOST_SHOWN
from msahl.deck.schema import objection, schema_bytes
from msahl.post.cli import main as post
from tests.deck.test_faults import DECK, changed, faults_of
from tests.support.models import ROOT

SINGLE = ROOT / "decks" / "thesis" / "single_pendulum_45.xml"
HINGE = """<data><system><bodies><ground><name>G</name></ground>{body}</bodies><joints><revolute>
<name>H</name><parent><name>G</name><axis><z>1</z></axis></parent><child><name>B0</name></child>
</revolute></joints><motions>{motion}</motions><loads>{load}</loads></system><simulation>
<deltaT>{dt}</deltaT><tFinal>{dt}</tFinal></simulation></data>"""
BODY = (
    "<rigidBody><name>B{i}</name><mass>{mass}</mass><rGB><x>{arm}</x></rGB><moi about='{about}'>"
    "<Ixx>{J}</Ixx><Iyy>{J}</Iyy><Izz>{J}</Izz></moi></rigidBody>"
)
PLAIN = {"i": 0, "mass": 1, "arm": 0, "about": "G", "J": 1}


def call(command, *words):
    result = CliRunner().invoke(command, [str(word) for word in words])
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    return result


def hinge(tmp_path: Path, motion="", load="", dt=0.01, **body) -> Path:
    path = tmp_path / "deck.xml"
    text = BODY.format(**(PLAIN | body))
    path.write_text(HINGE.format(body=text, motion=motion, load=load, dt=dt), encoding="utf-8")
    return path


AT_THE_EDGE = {
    "heavy": {"mass": 1e100},
    "light": {"mass": 1e-100},
    "large": {"J": 1e100},
    "small": {"J": 1e-100},
    "large and light": {"J": 1e100, "mass": 1e-100},
    "small and heavy": {"J": 1e-100, "mass": 1e100},
    "far": {"arm": 1e100},
    "far and heavy": {"arm": 1e100, "mass": 1e100},
}


@pytest.mark.parametrize("case", AT_THE_EDGE)
def test_numbers_at_the_edge_make_a_start_or_are_reported_by_name(tmp_path, case):
    told = call(main, "explain", hinge(tmp_path, **AT_THE_EDGE[case]))
    assert told.exit_code == 0 or "numbers of body 'B0' went beyond" in told.stderr


def test_an_inertia_about_b_that_overflows_about_g_is_impossible(tmp_path):
    (fault,) = faults_of(hinge(tmp_path, arm=1e100, mass=1e100, about="B"))
    assert "all must be greater than zero" in fault


CURVES = {
    "ramp of no time": "<ramp><to>1</to><end>1e-99</end></ramp>",
    "ramp of all time": "<ramp><to>1e-99</to><end>1e99</end></ramp>",
}


def test_a_ramp_too_short_for_its_slopes_is_a_fault(tmp_path):
    law = CURVES["ramp of no time"]
    motion = (
        "<jointMotion><name>M</name><joint>H</joint><coordinate>angle</coordinate>"
        "<law>{}</law></jointMotion>"
    )
    (fault,) = faults_of(hinge(tmp_path, motion.format(law)))
    assert ": motion 'M', law/ramp: no curve can be computed through it; space its" in fault
    slow = hinge(tmp_path, motion.format(CURVES["ramp of all time"]))
    assert call(main, "explain", slow).exit_code == 0


@pytest.mark.parametrize(
    ("way", "places"), [("cubic", "-1e100 0 1 1e100"), ("periodic", "0 1e-99 2e-99 1")]
)
def test_a_table_too_uneven_for_a_spline_is_a_fault(tmp_path, way, places):
    entries = zip(places.split(), (0, 1e20, 3e20, 0), strict=True)
    rows = "".join(f"<entry><angle>{x}</angle><moment>{y}</moment></entry>" for x, y in entries)
    table = f"<table interpolation='{way}'>{rows}</table>"
    kind = "torsionalSpringDamper"
    load = f"<{kind}><name>S</name><joint>H</joint>{table}</{kind}>"
    (fault,) = faults_of(hinge(tmp_path, load=load))
    assert ": load 'S', table: no curve can be computed through it" in fault


def test_a_message_lists_no_more_names_than_one_reads(tmp_path):
    bodies = "".join(BODY.format(**PLAIN | {"i": i}) for i in range(100))
    path = hinge(tmp_path)
    text = path.read_text().replace(BODY.format(**PLAIN), bodies)
    path.write_text(text.replace("<child><name>B0<", "<child><name>Z<"))
    (fault,) = faults_of(path)
    assert fault.endswith(f"(bodies: G, {', '.join(f'B{i}' for i in range(MOST_LISTED - 1))}, "
                          f"and {101 - MOST_LISTED} more)")  # fmt: skip


def test_of_many_faults_the_first_are_shown_and_the_others_counted(tmp_path):
    path = tmp_path / "deck.xml"
    path.write_text(DECK.replace("<bodies>", "<bodies>" + "<ground/>\n" * (2 * MOST_KEPT)))
    *shown, last = faults_of(path)
    assert [int(fault.split(":")[1]) for fault in shown] == list(range(4, 4 + MOST_SHOWN))
    assert last == f": {2 * MOST_KEPT - MOST_SHOWN} more faults are not shown; correct these first"


def bodies(n, **changes):
    return "\n".join(BODY.format(**PLAIN | {"i": i} | changes) for i in range(n))


def joints(n, end):
    ends = f"<parent><name>{end}</name></parent><child><name>B0</name></child>"
    return "\n".join(f"<spherical><name>J{i}</name>{ends}</spherical>" for i in range(n))


MANY_FAULTS = {
    "unknown elements": lambda n: (bodies(1) + "<bdy/>" * n, ""),
    "unknown elements of many tags": lambda n: (
        bodies(1) + "".join(f"<b{i}/>" for i in range(n)), ""),
    "unknown children of one body": lambda n: (
        bodies(1).replace("<mass>", "<foo/>" * n + "<mass>"), ""),
    "missing children": lambda n: (bodies(1) + "<rigidBody/>" * n, ""),
    "bad numbers": lambda n: (bodies(n, mass="one"), ""),
    "impossible numbers": lambda n: (bodies(n, mass=-1), ""),
    "duplicate names": lambda n: (bodies(1) + "<ground><name>G</name></ground>" * n, ""),
    "misspelt references": lambda n: (bodies(1), joints(n, "Grund")),
    "many names and misspelt references": lambda n: (bodies(n), joints(n, "Grund")),
    "none": lambda n: (bodies(n), ""),
}  # fmt: skip


def work(path):
    """Functions entered while a deck is read: what Python's time goes with on any machine."""
    count = 0

    def enter(frame, event, argument):
        nonlocal count
        count += event in ("call", "c_call")

    sys.setprofile(enter)
    with suppress(DeckError):
        try:
            read_deck(path, thorough=True)
        finally:
            sys.setprofile(None)
    return count


@pytest.mark.sampled
@pytest.mark.parametrize("kind", MANY_FAULTS)
def test_reading_takes_time_with_the_number_of_faults_not_with_its_square(
    tmp_path, kind, monkeypatch
):
    # So few are kept that the two decks differ by the work of each fault alone.
    monkeypatch.setattr(msahl.deck.faults, "MOST_KEPT", MOST_SHOWN)
    counts = []
    for n in (100, 200, 400, 800):
        body, joint = MANY_FAULTS[kind](n)
        path = tmp_path / "deck.xml"
        text = HINGE.format(body=body, motion="", load="", dt=0.01)
        path.write_text(text.replace("</joints>", f"{joint}</joints>"))
        counts.append(work(path))
    _, *counts = counts  # the first also fills caches
    first, second = counts[1] - counts[0], counts[2] - counts[1]
    # Twice as many more take twice as much more, but for a few per cent of what does not grow.
    assert second < 2.2 * first


def test_libxml2_takes_as_long_for_faulty_elements_as_for_good_ones(tmp_path):
    # Of a tree in memory lxml notes the path of every error, a walk past all siblings before it:
    # a hundred times as long as reading these bodies takes, and longer with their number. As they
    # are read it takes five times as long; thirty leaves workspace for a busy machine.
    n = 20_000
    root = etree.fromstring(
        "<data><system><bodies>" + "<rigidBody/>" * n + "</bodies></system></data>"
    )
    times = [time.process_time()]
    etree.fromstring(etree.tostring(root))
    times.append(time.process_time())
    assert objection(root, schema_bytes())
    times.append(time.process_time())
    assert times[2] - times[1] < 30.0 * (times[1] - times[0])


def test_a_message_is_of_bounded_length_and_keeps_both_ends(tmp_path):
    (fault,) = faults_of(changed(tmp_path, ('"kg">2', f'"{"k" * 10**6}">2')))
    assert fault.startswith(":8: body 'Bob', mass: unknown unit 'kkk")
    assert fault.endswith("expected one of kg, g, slug, lbm")
    assert len(fault) < 2 * LONGEST


def test_no_message_commands_the_terminal(tmp_path):
    (fault,) = faults_of(changed(tmp_path, ("<name>Pivot<", "<name>\x9b31m\u202e<")))
    assert "joint '\\x9b31m\\u202e', name: a name must not contain" in fault
    path = changed(tmp_path, ("<title>t<", "<title>\x9b31m<"))
    assert read_deck(path).simulation.title == "\\x9b31m"


def test_a_name_that_is_space_to_python_alone_names_no_body(tmp_path):
    (fault,) = faults_of(changed(tmp_path, ("<body>Bob<", "<body>\u3000<")))
    assert ":32: load 'Push': body '\\u3000' is not a body of this model" in fault


def test_an_element_of_many_attributes_is_no_decks(tmp_path):
    many = " ".join(f'a{i}="1"' for i in range(20))
    assert faults_of(changed(tmp_path, ("<moi>", f"<moi {many}>"))) == [
        ":10: <moi> has 20 attributes"
    ]


def test_wrong_children_are_looked_at_once(tmp_path, monkeypatch):
    asked = []
    monkeypatch.setattr(difflib, "get_close_matches", lambda *given, n: asked.append(given) or [])
    assert len(faults_of(changed(tmp_path, ("<joints>", "<joints>" + "<foo/>" * 90)))) == 90
    assert len(asked) == 90


def test_subsystems_are_split_in_one_look_at_every_element(tmp_path, monkeypatch):
    drag = "<drag><name>F{i}</name><body>B{i}</body><coefficient>1</coefficient></drag>"
    bodies, loads = (
        "".join(text.format(**PLAIN | {"i": i}) for i in range(50)) for text in (BODY, drag)
    )
    path = tmp_path / "deck.xml"
    path.write_text(_bodies(bodies, loads))
    model = read_deck(path)
    looked = []
    touched = msahl.system.subsystems._touched
    monkeypatch.setattr(
        msahl.system.subsystems,
        "_touched",
        lambda *given: looked.append(given[0]) or touched(*given),
    )
    subsystems = msahl.system.subsystems.split(model)
    assert [(len(subsystem.bodies), len(subsystem.loads)) for subsystem in subsystems] == [
        (1, 1)
    ] * 50
    assert looked == list(model.loads)


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        (["--every", 10**30], "is not in the range"),
        (["--scheme", "decaying", "--damping", "nan"], "'--damping': nan is not a finite number"),
        (["--dt", "nan"], "'--dt': nan is not a finite number"),
        (["--dt", "1e-300"], "deltaT: it is 1e-300 s"),
        (["--t-final", "1e300"], "tFinal: it is 1e+300 s"),
    ],
)
def test_an_option_that_is_no_number_is_refused(tmp_path, options, expected):
    told = call(main, "run", SINGLE, "-o", tmp_path / "run", *options)
    assert told.exit_code == 2
    assert expected in told.stderr
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize("end", ["nan", "-1", "0", "1e300"])
def test_a_study_to_no_end_is_refused(tmp_path, end):
    told = call(main, "study", SINGLE, "--t-final", end, "-o", tmp_path / "study")
    assert told.exit_code == 2
    expected = "'--t-final': nan is not a finite number" if end == "nan" else "tFinal: it is"
    assert expected in told.stderr


def test_a_tolerance_that_is_no_number_compares_nothing(tmp_path):
    told = call(post, "compare", tmp_path, tmp_path, "--rtol", "nan")
    assert told.exit_code == 2
    assert "a tolerance must be a number" in told.stderr


def test_a_file_name_need_not_be_utf_8(tmp_path):
    path = Path(str(tmp_path) + "/\udcff.xml")
    path.write_bytes(SINGLE.read_bytes())
    assert call(main, "run", path, "-o", tmp_path / "run", "--t-final", 0.01).exit_code == 0
    assert "\ufffd.xml" in (tmp_path / "run" / "run.json").read_text(encoding="utf-8")


def test_a_model_whose_joints_bear_nothing_has_a_report(tmp_path):
    path = hinge(tmp_path)
    path.write_text(path.read_text().replace("<title>", "<title>$x_{ \u4e2d"))
    assert call(main, "run", path, "-o", tmp_path / "run").exit_code == 0
    assert call(post, "report", tmp_path / "run").exit_code == 0


ABSURD = {
    "1e18 steps": (lambda: DECK.replace(">0.01<", ">1e-9<").replace(">1<", ">1e9<"), 2),
    "nesting of 1e5": (lambda: "<data>" * 10**5, 2),
    "1e5 wrong elements": (lambda: _bodies("<foo/>" * 10**5), 2),
    "1e5 attributes": (lambda: "<data " + "".join(f'a{i}="" ' for i in range(10**5)) + "/>", 2),
    "a number of 1e6 digits": (lambda: DECK.replace(">2.0<", f">{'1' * 10**6}<"), 2),
    "a name of 1e5 characters": (lambda: _bodies(_body("n" * 10**5)), 0),
}
"""Decks that are read or refused within seconds, with the exit status of check."""
COUNTED = {
    "bodies": (10**5, lambda count: _bodies("".join(_body(i) for i in range(count))), 0),
    "empty elements": (10**6, lambda count: "<data>" + "<a/>" * count + "</data>", 2),
    "rows of a table": (10**6, lambda count: _bodies(_body(0), _table(count)), 0),
}
"""Decks whose reading takes time in proportion to a count; the largest count that is tried."""


def _body(i) -> str:
    return BODY.format(**PLAIN | {"i": i})


def _bodies(bodies: str, loads: str = "") -> str:
    joints = DECK[DECK.index("<joints>") : DECK.index("</loads>")]
    body = DECK[DECK.index("<rigidBody>") : DECK.index("</bodies>")]
    return DECK.replace(joints, f"<loads>{loads}").replace(body, bodies)


def _table(rows: int) -> str:
    entries = "".join(f"<entry><t>{i}</t><value>1</value></entry>" for i in range(rows))
    return (
        "<concentrated><name>F</name><body>B0</body><force><xForce>1</xForce></force>"
        f"<law><table>{entries}</table></law></concentrated>"
    )


LIBRARIES, DECKS_SHARE = 1.4 * 2**30, 2.6 * 2**30
"""Bytes of address space that Python with its libraries takes, and that the largest deck may."""


def check_within(path, share, seconds):
    """The finished ``msahl check``, given a share of the memory and some seconds."""
    most = int(LIBRARIES + share * DECKS_SHARE)
    return subprocess.run(
        [sys.executable, "-c", "from msahl.cli.main import main; main()", "check", str(path)],
        capture_output=True,
        text=True,
        timeout=seconds,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (most, most)),
    )


@pytest.mark.slow
@pytest.mark.parametrize("case", ABSURD)
def test_absurd_decks_are_judged_within_bounds_of_time_and_memory(tmp_path, case):
    make, status = ABSURD[case]
    path = tmp_path / "deck.xml"
    path.write_text(make())
    ran = check_within(path, 1.0, 60)
    assert ran.returncode == status, ran.stderr[-500:]


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.05, pytest.param(1.0, marks=pytest.mark.slow)])
@pytest.mark.parametrize("case", COUNTED)
def test_large_decks_take_time_and_memory_in_proportion_to_their_size(tmp_path, case, share):
    largest, make, status = COUNTED[case]
    path = tmp_path / "deck.xml"
    path.write_text(make(int(share * largest)))
    ran = check_within(path, max(share, 0.1), 300 * max(share, 0.1))
    assert ran.returncode == status, ran.stderr[-500:]
    assert "Traceback" not in ran.stderr
    assert max(map(len, (ran.stderr or ran.stdout).splitlines())) < 3000
    assert len(ran.stderr.splitlines()) <= MOST_SHOWN + 1
