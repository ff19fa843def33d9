"""The command msahl-post sweep: tables, pictures, page, best point, damaged folders."""

import csv
import io
import json
import math
import subprocess
import sys

import numpy as np
import pytest
from click.testing import CliRunner

from msahl.cli.main import main as msahl
from msahl.post.cli import main
from msahl.post.measures import parse_measure, unit_of
from msahl.post.sweep import read as reading
from msahl.post.sweep import sweep_page
from msahl.post.sweep.read import read_sweep
from msahl.post.sweep.statistics import indices_of
from msahl.post.sweep.sweep_page import write_sweep_page
from msahl.post.sweep.sweep_tables import all_indices
from msahl.results.info import ResultError
from msahl.sweep import store
from tests.support.hostile import PAYLOADS as HOSTILE
from tests.support.hostile import assert_nothing_ran
from tests.support.models import ROOT
from tests.support.sweep_folders import ishigami, ishigami_indices, write_sweep

PAYLOADS = (
    "<script>alert(1)</script>",
    '"><img src=x onerror=alert(1)>',
    "</script><script>alert(1)</script>",
    "--><svg onload=alert(1)>",
    "javascript:alert(1)",
    "$x_{",
)


def call(*words):
    return CliRunner().invoke(main, [str(word) for word in words])


def grid(folder, **more):
    """A grid of 4 by 3 points with f = a + 10 b, of which two failed and one has FAIL."""
    a, b = np.meshgrid([1.0, 2.0, 3.0, 4.0], [0.0, 1.0, 2.0])
    a, b = a.ravel(), b.ravel()
    values = [None if k in (0, 5) else v for k, v in enumerate(a + 10.0 * b)]
    status = ["completed"] * 12
    status[0], status[5] = "not converged", "timed out"
    verdict = ["PASS"] * 12
    verdict[11] = "FAIL"
    return write_sweep(
        folder, {"a": a, "b [cm]": b}, {"Tip.z max": values}, status, verdict, **more
    )


def files(result):
    return [line.rpartition("/")[2] for line in result.stdout.splitlines() if "/report/" in line]


def test_names_of_files_and_columns_are_those_of_the_store():
    assert (reading.INFO, reading.RUNS, reading.SECONDS) == (
        store.INFO, store.RUNS, store.SECONDS
    )  # fmt: skip
    assert (reading.STATUS, reading.VERDICT, reading.ERROR) == store.OUTCOME
    assert reading.LOOP in store.SECONDS_COLUMNS


def test_failed_points_are_counted_everywhere(tmp_path):
    folder = grid(tmp_path / "s")
    result = call("sweep", folder)
    assert result.exit_code == 0, result.output
    told = "12 points: 10 completed, 2 failed (1 not converged, 1 timed out); 1 of those completed"
    assert told in result.stdout
    assert files(result) == ["sweep.html", "statistics.csv", "map-1.png"]
    page = (folder / "report" / "sweep.html").read_text()
    assert told in page
    assert "2 points failed. They are part of no statistic and no curve." in page
    (row,) = csv.DictReader(io.StringIO((folder / "report" / "statistics.csv").read_text()))
    assert (row["points"], row["missing"], row["fail"]) == ("12", "2", "1")
    assert (row["min"], row["max"]) == ("2.0", "24.0")
    assert row["max_at"] == "a = 4, b = 2 cm"


@pytest.mark.parametrize(("goal", "point", "value"), [("min", 2, 2.0), ("max", 11, 23.0)])
def test_the_best_point_did_not_fail(tmp_path, goal, point, value):
    """The largest value of all is that of point 12, whose verdict is FAIL."""
    result = call("sweep", grid(tmp_path / "s"), "--best", "Tip.z  max", goal, "--json")
    (found,) = json.loads(result.stdout)
    assert (found["point"], found["Tip.z max"]) == (point, value)
    assert (
        "chosen from 9 points; not considered: 2 failed, 1 with the verdict FAIL" in result.stderr
    )


def test_best_of_an_unknown_measure(tmp_path):
    result = call("sweep", grid(tmp_path / "s"), "--best", "Tip.y max", "min")
    assert result.exit_code == 2
    assert "no measure 'Tip.y max' of numbers (it has: 'Tip.z max')" in result.stderr


def test_best_without_any_good_point(tmp_path):
    folder = write_sweep(
        tmp_path / "s", {"a": [1.0, 2.0]}, {"f max": [1.0, 2.0]}, None, ["FAIL"] * 2
    )
    result = call("sweep", folder, "--best", "f max", "min")
    assert result.exit_code == 2
    assert "no point to choose from by 'f max': 2 with the verdict FAIL" in result.stderr


PLANS = {
    "one parameter": ({"a": [1.0, 2.0, 3.0]}, {}, ["over-1.png"]),
    "words": ({"--scheme": ["x", "y", "z"]}, {}, ["over-1.png"]),
    "number and words": (
        {"a": [1.0, 2.0, 1.0, 2.0], "--scheme": ["x", "x", "y", "y"]}, {}, ["over-1.png"],
    ),
    "points of two": ({"a": [1.0, 2.0, 3.0], "b": [3.0, 1.0, 2.0]}, {}, ["over-1.png"]),
    "three": (
        {"a": [1.0, 1.0, 2.0, 2.0], "b": [1.0, 2.0, 1.0, 2.0], "c": [1.0, 2.0, 3.0, 4.0]}, {},
        ["scatter.png"],
    ),
    "sample of one": (
        {"a": [0.1, 0.5, 0.7]}, {"sample": {"kind": "lhs", "n": 3, "seed": 1}},
        ["histogram-1.png", "over-1.png"],
    ),
    "sample of two": (
        {"a": [0.1, 0.5, 0.7], "b": [0.9, 0.1, 0.2]},
        {"sample": {"kind": "random", "n": 3, "seed": 1}}, ["histogram-1.png", "scatter.png"],
    ),
    "cost": (
        {"--dt": [0.1, 0.01, 0.1, 0.01], "--scheme": ["x", "x", "y", "y"]},
        {"error": [1e-2, 1e-4, 1e-3, 1e-6], "seconds": [0.1, 1.0, 0.2, 2.0]},
        ["over-1.png", "error-over-time.png"],
    ),
    "one point": ({"a": [1.0]}, {}, []),
    "all failed": ({"a": [1.0, 2.0]}, {"status": ["crashed"] * 2}, []),
}  # fmt: skip


@pytest.mark.parametrize("name", PLANS)
def test_pictures_follow_from_the_plan(tmp_path, name):
    parameters, more, names = PLANS[name]
    n = len(next(iter(parameters.values())))
    values = [None if more.get("status") else float(k) for k in range(1, n + 1)]
    folder = write_sweep(tmp_path / "s", parameters, {"f max": values}, **more)
    result = call("sweep", folder)
    assert result.exit_code == 0, result.output
    assert [name for name in files(result) if name.endswith("png")] == names


def test_a_sweep_that_is_not_complete(tmp_path):
    folder = grid(tmp_path / "s", planned=20)
    result = call("sweep", folder, "--csv")
    assert "20 points: 10 completed, 2 failed" in result.stderr
    assert "8 not computed yet" in result.stderr
    (row,) = csv.DictReader(io.StringIO(result.stdout))
    assert (row["points"], row["missing"]) == ("20", "10")
    assert not (folder / "report").exists()


def test_cells_with_units_are_numbers_and_mixed_units_are_words(tmp_path):
    parameters = {"a": ["1 cm", "2 cm"], "b": ["1 cm", "2 m"]}
    sweep = read_sweep(write_sweep(tmp_path / "s", parameters, {"f max": [1.0, 2.0]}))
    assert sweep.parameters[0].name == "a [cm]"
    np.testing.assert_array_equal(sweep.parameters[0].values, [1.0, 2.0])
    assert sweep.parameters[1].values is None


@pytest.mark.parametrize(
    ("measure", "unit"),
    [
        ("Tip.z max", "m"), ("Hinge.F absmax", "N"), ("Crank.angle final", "rad"), ("error", "m"),
        ("time of Crank.angle = 1.57", "s"), ("seconds", "s"), ("Tip.vx at 0.5", "m/s"),
        ("phase final", ""), ("steps", ""), ("displacement of Tip.z max", "m"),
        ("displacement of Crank.angle at 2", "rad"), ("speedMax", "m/s"),
    ],
)  # fmt: skip
def test_units_of_measures(measure, unit):
    assert unit_of(parse_measure(measure)) == unit


def test_the_page_has_short_numbers_and_units(tmp_path):
    parameters = {"a": [0.30000000000000004, 0.1, 2.0 / 3.0], "b": [1.0, 1.0 + 1e-9, 2.0]}
    folder = write_sweep(tmp_path / "s", parameters, {"load final": [1.0, 2.0, 3.0]})
    info = json.loads((folder / "sweep.json").read_text())
    info["units"] = {"a": "rad/s", "load final": "N m"}
    (folder / "sweep.json").write_text(json.dumps(info))
    result = call("sweep", folder)
    assert result.exit_code == 0
    page = (folder / "report" / "sweep.html").read_text()
    assert "0.30000000000000004" not in page + result.stdout
    for text in ("a [rad/s]", "load final [N m]", ">0.3<", ">0.666667<", ">1.000000001<"):
        assert text in page, text
    assert "a = 0.3 rad/s, b = 1" in result.stdout


@pytest.mark.slow
def test_hostile_names_run_no_script(tmp_path):
    parameters = {PAYLOADS[2]: [1.0, 2.0, 3.0], PAYLOADS[5]: [*PAYLOADS[:3]]}
    measures = {payload: [1.0, None, 3.0] for payload in PAYLOADS[:2]}
    status = ["completed", "crashed", "completed"]
    folder = write_sweep(
        tmp_path / "s", parameters, measures, status, messages=["", PAYLOADS[2], ""],
        deck=f"decks/{PAYLOADS[0]}.xml",
    )  # fmt: skip
    result = call("sweep", folder)
    assert result.exit_code == 0, result.output
    page = (folder / "report" / "sweep.html").read_text()
    assert page.count("<script") == _scripts_of_a_plain_page(tmp_path)
    for harmful in ("<script>alert", "<img src=x", "<svg onload", 'href="javascript'):
        assert harmful not in page
    assert "&lt;script&gt;alert(1)&lt;/script&gt;" in page
    assert all(name.rpartition(".")[0].replace("-", "").isalnum() for name in files(result))


def test_a_browser_shows_hostile_names_as_they_are(tmp_path, open_page):
    n = len(HOSTILE)
    folder = write_sweep(
        tmp_path / "s", {HOSTILE[0]: list(range(n)), "b": HOSTILE},
        {HOSTILE[1]: [3.0] * (n - 1) + [4.0]}, ["completed", "crashed"] + ["completed"] * (n - 2),
        messages=HOSTILE, deck=HOSTILE[2],
    )  # fmt: skip
    assert call("sweep", folder).exit_code == 0
    page = open_page(folder / "report" / "sweep.html")
    page.evaluate("document.querySelectorAll('details').forEach(each => each.open = true)")
    assert_nothing_ran(page)
    text = page.inner_text("body")
    assert all(name in text for name in HOSTILE if name.isprintable())
    # A sweep of this size has one picture, of vectors; the page fits the window.
    assert page.evaluate("document.querySelectorAll('figure svg').length") == 1
    assert page.evaluate("document.documentElement.scrollWidth <= window.innerWidth")


def _scripts_of_a_plain_page(tmp_path):
    folder = write_sweep(tmp_path / "plain", {"a": [1.0, 2.0]}, {"f max": [1.0, 2.0]})
    assert call("sweep", folder).exit_code == 0
    return (folder / "report" / "sweep.html").read_text().count("<script")


@pytest.mark.slow
def test_the_same_sweep_gives_the_same_bytes(tmp_path):
    folder = grid(tmp_path / "s")
    for name in ("one", "two"):
        assert call("sweep", folder, "-o", tmp_path / name, "--format", "pdf").exit_code == 0
    one, two = ({p.name: p.read_bytes() for p in (tmp_path / n).iterdir()} for n in ("one", "two"))
    assert one == two


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda d: (d / "sweep.json").unlink(), "not the folder of a sweep (no sweep.json)"),
        (lambda d: (d / "sweep.json").write_text("{"), "not JSON"),
        (lambda d: (d / "sweep.json").write_text("[]"), "the file is a list, not an object"),
        (lambda d: (d / "runs.csv").unlink(), "the sweep has no outcomes yet"),
        (lambda d: (d / "runs.csv").write_text("point,a\n1,2\n"), "no column 'b [cm]'"),
        (lambda d: (d / "runs.csv").write_bytes(b"\xff\xfe"), "cannot be read"),
        (
            lambda d: (d / "runs.csv").write_text((d / "runs.csv").read_text() + "1,2\n"),
            "runs.csv:14: 2 cells under 9 columns",
        ),
    ],
)
def test_damaged_folders_are_one_sentence(tmp_path, damage, message):
    folder = grid(tmp_path / "s")
    damage(folder)
    result = call("sweep", folder)
    assert result.exit_code == 2
    assert message in result.stderr
    assert result.stderr.count("\n") == 1


def places(value, path=()):
    """The keys to every part of a JSON value."""
    yield path
    if isinstance(value, dict | list):
        for key in value if isinstance(value, dict) else range(len(value)):
            yield from places(value[key], (*path, key))


def put(value, path, new):
    """A copy of a JSON value with a ``new`` part."""
    if not path:
        return new
    copied = value.copy()
    copied[path[0]] = put(value[path[0]], path[1:], new)
    return copied


def is_refused(folder):
    """Whether a folder is refused, in one line; a page of it is written otherwise."""
    try:
        read = read_sweep(folder)
    except ResultError as error:
        return "\n" not in str(error)
    write_sweep_page(read, all_indices(read), folder / "report", ())
    return False


@pytest.mark.slow
@pytest.mark.parametrize("sample", [None, {"kind": "saltelli", "n": 3, "seed": 0}])
def test_every_field_may_hold_any_value(tmp_path, sample, monkeypatch):
    monkeypatch.setattr(sweep_page, "pictures", lambda *_: ())  # which take most of the time
    folder, refused, cases = grid(tmp_path / "s", sample=sample), 0, 0
    for name, values in (
        ("sweep.json", (None, True, -1, 1e308, "x", [], [1], [[]], {}, {"a": [1]})),
        ("runs.csv", ("", "x", "-1", "1e999", "nan", "\u0661", "\x00", '"a\nb"')),
    ):
        sound = (folder / name).read_text()
        is_json = name == "sweep.json"
        content = json.loads(sound) if is_json else [line.split(",") for line in sound.splitlines()]
        for path in places(content):
            if name == "runs.csv" and (len(path) != 2 or path[0] > 1):
                continue
            for value in values:
                changed = put(content, path, value)
                text = json.dumps(changed) if is_json else "\n".join(map(",".join, changed)) + "\n"
                (folder / name).write_text(text)
                refused += is_refused(folder)
                cases += 1
        (folder / name).write_text(sound)
    assert 0.2 * cases < refused < cases


@pytest.mark.slow
def test_statistics_do_without_matplotlib(tmp_path):
    folder = grid(tmp_path / "s")
    script = (
        "import sys; from msahl.post.cli import main; "
        f"main(['sweep', {str(folder)!r}, '--csv'], standalone_mode=False); "
        "assert 'matplotlib' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", script], check=True, capture_output=True)


def run_sweep(folder, *words):
    result = CliRunner().invoke(msahl, ["sweep", *words, "--jobs", "1", "-q", "-o", str(folder)])
    assert result.exit_code == 0, result.output
    return read_sweep(folder)


@pytest.mark.slow
def test_a_sweep_from_the_plan_to_the_page(tmp_path):
    deck = str(ROOT / "decks" / "forces" / "slide_spring.xml")
    words = (deck, "--t-final", "0.1", "--over", "dt=0.01,0.02", "--measure", "Block.x max")
    sweep = run_sweep(tmp_path / "s", *words)
    assert (sweep.planned, sweep.count) == (2, 2)
    assert [m.label for m in sweep.asked] == ["Block.x max [m]"]
    assert [p.name for p in sweep.varied] == ["--dt [s]"]
    assert np.isfinite(sweep.seconds).all()
    result = call("sweep", tmp_path / "s")
    assert result.exit_code == 0, result.output
    assert "error-over-time.png" in files(result)


ISHIGAMI = """<?xml version="1.0" encoding="UTF-8"?>
<data>
  <unitSystem>SI</unitSystem>
  <parameters>
    <parameter name="x1">0.5</parameter>
    <parameter name="x2">0.5</parameter>
    <parameter name="x3">0.5</parameter>
  </parameters>
  <system>
    <bodies>
      <ground><name>Base</name></ground>
      <rigidBody>
        <name>Body</name><mass>1</mass><moi><Ixx>1</Ixx><Iyy>1</Iyy><Izz>1</Izz></moi>
        <initialConditions>
          <velocity basis="Base">
            <v1>{sin(x1) + 7*sin(x2)^2 + 0.1*x3^4*sin(x1)}</v1>
          </velocity>
        </initialConditions>
      </rigidBody>
    </bodies>
  </system>
  <simulation><deltaT>1</deltaT><tFinal>1</tFinal></simulation>
</data>
"""


@pytest.mark.slow
def test_indices_of_ishigami_through_a_deck(tmp_path):
    """A free body whose velocity is Ishigami's function of three parameters of its deck: after 1 s
    it is its displacement."""
    (tmp_path / "deck.xml").write_text(ISHIGAMI)
    drawn = [word for k in "123" for word in ("--set", f"x{k}~uniform(-{math.pi!r},{math.pi!r})")]
    words = (*drawn, "--sample", "saltelli:512", "--seed", "7", "--measure", "Body.x final")
    sweep = run_sweep(tmp_path / "s", str(tmp_path / "deck.xml"), *words)
    found = indices_of(sweep, sweep.measure("Body.x final"))
    for exact, ends in zip(
        ishigami_indices(), (found.first_interval, found.total_interval), strict=True
    ):
        assert np.all((ends[:, 0] <= exact) & (exact <= ends[:, 1]))
    x = np.stack([p.values for p in sweep.parameters], axis=1)
    # One step of a free body: a few roundings of numbers up to 20.
    np.testing.assert_allclose(sweep.measures[0].values, ishigami(x), rtol=0, atol=1e-12)
