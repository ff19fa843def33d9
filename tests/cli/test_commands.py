"""The command msahl: exit statuses, files, messages, and what it does not load."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from click.testing import CliRunner

from msahl.cli.main import main
from msahl.results.read import read_table
from tests.support.models import DECKS, ROOT

THESIS = ROOT / "decks" / "thesis"
SINGLE = THESIS / "single_pendulum_45.xml"
LOADS = ROOT / "decks" / "basics" / "loads.xml"
FREE = ROOT / "decks" / "basics" / "torque_free.xml"

BLASTED = """<data><system><gravity><g3>9.8</g3></gravity><bodies><ground><name>Base</name></ground>
<rigidBody><name>Bob</name><mass>2</mass><moi><Ixx>.1</Ixx><Iyy>.1</Iyy><Izz>.1</Izz></moi>
<initialConditions><position><z>5</z></position></initialConditions></rigidBody></bodies>
<joints><spherical><name>Pivot</name><parent><name>Base</name></parent>
<child><name>Bob</name><position><z>-5</z></position></child></spherical></joints>
<loads><concentrated><name>Blast</name><body>Bob</body><position><z>1</z></position>
<force basis="Bob"><xForce>1e100</xForce><zForce>1e100</zForce></force></concentrated></loads>
</system><simulation><deltaT>0.01</deltaT><tFinal>1</tFinal></simulation></data>"""
"""No step of it can be solved: a force of 1e100 N that rotates with the body that it rotates."""


def call(*words):
    return CliRunner().invoke(main, [str(word) for word in words])


def run(*words, status=0):
    result = call("run", *words)
    assert result.exit_code == status, result.output
    return result


def python(code, *words, **environment):
    """A fresh interpreter; its standard output."""
    ran = subprocess.run(
        [sys.executable, "-c", code, *map(str, words)],
        env=os.environ | environment,
        capture_output=True,
        text=True,
        check=True,
    )
    return ran.stdout


def names(folder):
    return {path.name for path in folder.iterdir()}


def info(folder):
    return json.loads((folder / "run.json").read_text())


# run ---------------------------------------------------------------------------------------------


def test_a_run_writes_its_tables_its_deck_and_what_happened(tmp_path):
    result = run(SINGLE, "-o", tmp_path, "--t-final", 1)
    assert names(tmp_path) == {"states.csv", "reactions.csv", "error.csv", "run.json", "deck.xml"}
    assert result.stdout == ""
    assert "PASS: 500 steps to t = 1 s; energy conserved to" in result.stderr
    assert str(tmp_path) in result.stderr
    told = info(tmp_path)
    assert (told["status"], told["steps"], told["outputTimes"], told["time"]) == (
        "completed",
        500,
        501,
        1,
    )
    assert told["options"] == {
        "dt": 0.002,
        "tFinal": 1.0,
        "scheme": "preserving",
        "damping": 0.0,
        "reactions": "mean",
        "accelerations": "no",
        "jointTable": "auto",
        "outputInterval": None,
        "tolerance": None,
        "localTolerance": None,
        "error": None,
        "accuracy": None,
        "solver": "auto",
        "every": 1,
        "full": False,
        "rotationUpdate": "cayley",
        "degree": None,
    }
    assert told["scipySteps"] == 1
    assert {"prepare", "loop", "output", "total"} <= told["seconds"].keys()
    assert {"msahl", "python", "numba", "numpy", "scipy"} <= told.keys()
    states = read_table(tmp_path / "states.csv")
    # Times are decimals as one writes them: k tFinal / n, not a sum of steps.
    assert states["time"].tolist() == [k / 500 for k in range(501)]


def test_what_a_model_lacks_has_no_table(tmp_path):
    run(FREE, "-o", tmp_path / "free", "--t-final", 0.1)
    assert names(tmp_path / "free") == {"states.csv", "error.csv", "run.json", "deck.xml"}
    run(LOADS, "-o", tmp_path / "loads", "--t-final", 0.1)
    with_work = {"states.csv", "work.csv", "error.csv", "run.json", "deck.xml"}
    assert names(tmp_path / "loads") == with_work


def test_the_folder_is_results_and_the_decks_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    run(SINGLE, "--t-final", 0.01)
    assert names(tmp_path / "results" / "single_pendulum_45") >= {"states.csv", "run.json"}


def test_the_deck_beside_the_results_is_the_one_that_ran(tmp_path):
    shutil.copy(FREE, tmp_path / "own.xml")
    run(tmp_path / "own.xml", "-o", tmp_path / "as_it_is")
    assert (tmp_path / "as_it_is" / "deck.xml").read_bytes() == FREE.read_bytes()
    run(tmp_path / "own.xml", "-o", tmp_path / "other", "--dt", 0.02, "--t-final", 0.1)
    text = (tmp_path / "other" / "deck.xml").read_text()
    assert '<deltaT units="sec">0.02</deltaT>' in text
    assert '<tFinal units="sec">0.1</tFinal>' in text
    # Run again, the copy gives the same bytes.
    run(tmp_path / "other" / "deck.xml", "-o", tmp_path / "again")
    for name in ("states.csv", "deck.xml"):
        assert (tmp_path / "again" / name).read_bytes() == (tmp_path / "other" / name).read_bytes()


def test_step_and_end_may_be_given(tmp_path):
    run(SINGLE, "-o", tmp_path, "--dt", 0.05, "--t-final", 0.5)
    assert read_table(tmp_path / "states.csv")["time"].tolist() == [k / 20 for k in range(11)]


@pytest.mark.parametrize(
    ("dt", "t_final", "times"),
    [
        (0.3, 1.0, [0.0, 0.3, 0.6, 0.9, 1.0]),  # a last step of its own size
        (0.1, 0.3, [0.0, 0.1, 0.2, 0.3]),  # 3 x 0.1 is not 0.3 to the last bit
        (0.4, 0.5, [0.0, 0.4, 0.5]),
        (0.5, 0.5, [0.0, 0.5]),
    ],
)
def test_an_end_between_two_steps_is_reached_by_a_short_one(tmp_path, dt, t_final, times):
    run(SINGLE, "-o", tmp_path, "--dt", dt, "--t-final", t_final)
    table = read_table(tmp_path / "states.csv")
    assert table["time"].to_numpy() == pytest.approx(times, rel=1e-15)
    assert table["time"].iloc[-1] == t_final
    assert info(tmp_path)["extremes"]["constraintViolationMax"] < 1e-12


@pytest.mark.parametrize("every", [3, 7, 100])
def test_every_thins_the_rows_but_not_the_run(tmp_path, every):
    words = (SINGLE, "--dt", 0.01, "--t-final", 0.5)
    run(*words, "-o", tmp_path / "all")
    run(*words, "-o", tmp_path / "thin", "--every", every)
    for name in ("states.csv", "reactions.csv"):
        full, thin = (read_table(tmp_path / f / name).to_numpy() for f in ("all", "thin"))
        kept = sorted({*range(0, 51, every), 50})
        assert np.array_equal(thin, full[kept])
    told = [info(tmp_path / folder) for folder in ("all", "thin")]
    # Extremes are over all steps, written or not.
    assert told[0]["extremes"] == told[1]["extremes"]
    assert [t["outputTimes"] for t in told] == [51, len(kept)]


@pytest.mark.parametrize("solver", ["newton", "root", "auto"])
def test_the_solver_is_reported_and_counted(tmp_path, solver):
    run(SINGLE, "-o", tmp_path, "--t-final", 0.1, "--solver", solver)
    told = info(tmp_path)
    assert told["options"]["solver"] == solver
    assert told["scipySteps"] == {"newton": 0, "root": 50, "auto": 1}[solver]


def test_full_omits_nothing(tmp_path):
    for flags in ((), ("--full",)):
        run(SINGLE, "-o", tmp_path / str(len(flags)), "--t-final", 0.1, *flags)
    assert [info(tmp_path / n)["unknowns"] for n in "01"] == [5, 9]
    assert [info(tmp_path / n)["options"]["full"] for n in "01"] == [False, True]


def test_quiet_says_nothing_and_verbose_more(tmp_path):
    words = (THESIS / "top_1.xml", "--dt", 0.001, "--t-final", 0.1, "-o", tmp_path)
    assert run(*words, "-q").output == ""
    normal, verbose = run(*words).stderr, run(*words, "-v").stderr
    assert "initial velocities violate the joints' constraints by 0.198 m/s" in normal
    assert "unknowns in 1 subsystems" not in normal
    for word in ("prepare: ", "loop: ", "output: ", "9 unknowns in 1 subsystems", "0 subdivisions"):
        assert word in verbose


# What goes wrong ---------------------------------------------------------------------------------


def test_a_step_that_does_not_converge_is_status_3_with_all_on_disk(tmp_path):
    (tmp_path / "deck.xml").write_text(BLASTED)
    result = run(tmp_path / "deck.xml", "-o", tmp_path / "out", status=3)
    assert "step 1 from t = 0 s did not converge" in result.stderr
    assert "Try a smaller --dt" in result.stderr
    parts = {"states.csv.part", "reactions.csv.part", "work.csv.part", "error.csv.part"}
    assert names(tmp_path / "out") == {*parts, "run.json", "deck.xml"}
    assert len(read_table(tmp_path / "out" / "states.csv.part")) == 1
    told = info(tmp_path / "out")
    assert (told["status"], told["steps"], told["subdivisions"]) == ("not converged", 0, 10)
    assert told["message"] in result.stderr


def test_a_bad_deck_is_status_2_and_nothing_is_written(tmp_path):
    (tmp_path / "deck.xml").write_text(BLASTED.replace("<mass>2<", "<mass>-2<"))
    result = run(tmp_path / "deck.xml", "-o", tmp_path / "out", status=2)
    assert f"{tmp_path / 'deck.xml'}:2:" in result.stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("--dt", "0"), "deltaT"),
        (("--dt", "-1"), "deltaT"),
        (("--dt", "nan"), "--dt"),
        (("--t-final", "inf"), "--t-final"),
        (("--t-final", "0.001"), "tFinal"),
        (("--accuracy", "nan"), "'--accuracy': nan is not a finite number"),
        (("--accuracy", "inf"), "'--accuracy': inf is not a finite number"),
        (("--accuracy", "0"), "'--accuracy': 0.0 is not in the range"),
        (("--damping", "nan"), "'--damping': nan is not a finite number"),
        (("--output-interval", "-inf"), "'--output-interval': -inf is not a finite number"),
        (("--tolerance", "1e999"), "'--tolerance': 1e999 is not a finite number"),
        (("--scheme", "auto", "--tolerance", "1e300"), "greater than zero, 1e-100 to 1e+100 m"),
        (("--every", "0"), "--every"),
        (("--solver", "magic"), "--solver"),
        (("--scheme", "magic"), "--scheme"),
        (("--nonsense",), "--nonsense"),
    ],
)
def test_bad_usage_is_status_2(tmp_path, words, told):
    result = run(SINGLE, "-o", tmp_path / "out", *words, status=2)
    assert told in result.stderr
    assert not (tmp_path / "out").exists()


def test_a_folder_that_cannot_be_written_is_named_with_a_remedy(tmp_path):
    (tmp_path / "file").write_text("a file")
    result = run(SINGLE, "-o", tmp_path / "file" / "out", status=4)
    assert str(tmp_path / "file") in result.stderr
    assert "choose another folder with -o" in result.stderr
    assert "Traceback" not in result.output


def test_a_missing_deck_is_status_2(tmp_path):
    for command in ("run", "check", "explain"):
        result = call(command, tmp_path / "none.xml")
        assert result.exit_code == 2
        assert "none.xml" in result.stderr


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_run_keeps_its_rows_and_says_so(tmp_path, number):
    code = "from msahl.cli.main import main; main()"
    words = ["run", str(SINGLE), "-o", str(tmp_path), "--t-final", "100000", "--solver", "newton"]
    running = subprocess.Popen([sys.executable, "-c", code, *words], stderr=subprocess.PIPE)
    part = tmp_path / "states.csv.part"
    deadline = time.monotonic() + 120  # a cold compilation on a busy machine
    while not (part.exists() and part.stat().st_size > 5000):
        assert running.poll() is None
        assert time.monotonic() < deadline
        time.sleep(0.02)
    running.send_signal(number)
    _, told = running.communicate(timeout=60)
    assert running.returncode == 128 + number
    assert b"stopped at t = " in told
    parts = {"states.csv.part", "reactions.csv.part", "error.csv.part"}
    assert names(tmp_path) == {*parts, "run.json", "deck.xml", "checkpoint"}
    written = info(tmp_path)
    states = read_table(part)
    assert written["status"] == "interrupted"
    assert len(states) == written["outputTimes"] == written["steps"] + 1 > 1
    assert len(read_table(tmp_path / "reactions.csv.part")) == len(states)
    assert states["time"].iloc[-1] == pytest.approx(written["time"], rel=1e-15)


# Other commands ----------------------------------------------------------------------------------


@pytest.mark.slow
def test_check_reports_every_fault_of_every_deck(tmp_path):
    good = call("check", *DECKS)
    assert good.exit_code == 0
    assert good.stdout.splitlines() == [f"{path}: good" for path in DECKS]
    faulty = BLASTED.replace("<mass>2<", "<mass>-2<").replace("<deltaT>0.01<", "<deltaT>0<")
    (tmp_path / "deck.xml").write_text(faulty)
    bad = call("check", SINGLE, tmp_path / "deck.xml")
    assert bad.exit_code == 2
    assert bad.stdout == f"{SINGLE}: good\n"
    assert f"{tmp_path / 'deck.xml'}:2:" in bad.stderr
    assert f"{tmp_path / 'deck.xml'}:8:" in bad.stderr


@pytest.mark.parametrize("path", DECKS, ids=lambda path: path.stem)
def test_explain_covers_every_deck(path):
    result = call("explain", path)
    assert result.exit_code == 0, result.output
    assert len(result.stdout.splitlines()) > 3


def test_explain_describes_another_scheme():
    explicit = call("explain", SINGLE, "--scheme", "rk8")
    assert "scheme: rk8, of order 8; explicit: does not conserve" in explicit.stdout
    assert (
        "scheme: gauss of degree 4, of order 8"
        in call("explain", SINGLE, "--scheme", "gauss4").stdout
    )


def test_explain_says_why_explicit_steps_are_not_possible():
    refused = call("explain", ROOT / "decks/mechanisms/bicycle.xml", "--scheme", "rk4")
    assert refused.exit_code != 0
    assert "constraints between rates have no joint coordinates" in refused.stderr


@pytest.mark.parametrize("command", [(), ("run",), ("check",), ("explain",)])
def test_help_shows_an_example(command):
    for flag in ("-h", "--help"):
        result = call(*command, flag)
        assert result.exit_code == 0
        assert "msahl " + " ".join(command) in result.stdout
        assert "decks/" in result.stdout or not command


def test_version():
    import msahl

    assert call("--version").stdout == f"msahl, version {msahl.__version__}\n"


# What is loaded ----------------------------------------------------------------------------------

LOADED = """
import sys
from msahl.cli.main import main
try:
    main()
except SystemExit as end:
    assert not end.code, end.code
print(*sys.modules)
"""


SLOW = ("matplotlib", "numba", "numpy.typing", "pandas", "shlex", "xmlschema")
"""Packages that a run whose kernels are compiled does not import."""


@pytest.mark.parametrize(
    ("words", "absent", "present"),
    [
        (("run", "newton"), (*SLOW, "scipy", "scipy.optimize"), ("numpy", "llvmlite")),
        (("run", "auto"), (*SLOW, "scipy.optimize"), ("numpy", "llvmlite")),
        (("check",), ("matplotlib", "pandas", "scipy", "numba"), ("lxml", "xmlschema")),
        (("--version",), ("matplotlib", "pandas", "scipy", "numba", "numpy", "lxml"), ("click",)),
    ],
    ids=lambda words: " ".join(words),
)
def test_a_command_loads_what_it_needs(tmp_path, words, absent, present):
    command, *solver = words
    given = {
        "run": [SINGLE, "-o", tmp_path, "--t-final", 0.01, "--solver", *solver],
        "check": [SINGLE],
        "--version": [],
    }[command]
    modules = set(python(LOADED, command, *given).split())
    assert not modules.intersection(absent)
    assert modules.issuperset(present)


# The installed package ---------------------------------------------------------------------------


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """A wheel built from a copy of the sources and installed, read-only, into a folder."""
    folder = tmp_path_factory.mktemp("wheel")
    source, target = folder / "source", folder / "installed"
    source.mkdir()
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, source)
    ignored = shutil.ignore_patterns("__pycache__")
    for name in ("msahl", "schemas", "decks"):
        shutil.copytree(ROOT / name, source / name, ignore=ignored)
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "-q"]
    subprocess.run([*pip, "wheel", "--no-deps", "-w", folder, source], check=True)
    (wheel,) = folder.glob("*.whl")
    subprocess.run([*pip, "install", "--no-deps", "--target", target, wheel], check=True)
    for path in (target, *target.rglob("*")):
        path.chmod(path.stat().st_mode & ~0o222)
    yield target
    for path in (target, *target.rglob("*")):
        path.chmod(path.stat().st_mode | 0o200)


FROM_TARGET = """
import sys
# The checkout is installed as editable: it would complete a package that lacks modules.
sys.meta_path[:] = [f for f in sys.meta_path if "editable" not in getattr(f, "__module__", "")]
from msahl.cli.main import main
target = sys.argv.pop(1)
foreign = [name for name, module in sys.modules.items()
           if name.startswith("msahl") and not module.__file__.startswith(target)]
assert not foreign, foreign
main()
"""


def call_installed(installed, folder, words, **environment):
    """A process of the installed msahl in a folder that is not the checkout."""
    return subprocess.Popen(
        [sys.executable, "-c", FROM_TARGET, installed, *words],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(installed)} | environment,
        stderr=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )


@pytest.mark.slow
def test_an_installed_msahl_works_from_any_folder(installed, tmp_path):
    """Its sources are those of the checkout, and so are the compiled kernels that it loads."""
    checking = call_installed(installed, tmp_path, ["check", SINGLE])
    assert checking.communicate() == (f"{SINGLE}: good\n", "")
    words = [SINGLE, "--t-final", "0.1"]
    running = call_installed(installed, tmp_path, ["run", *words, "-o", "out"])
    told = running.communicate()[1]
    assert running.returncode == 0, told
    assert "50 steps to t = 0.1 s" in told
    run(*words, "-o", tmp_path / "checkout")
    tables = [(tmp_path / name / "states.csv").read_bytes() for name in ("out", "checkout")]
    assert tables[0] == tables[1]


@pytest.mark.slow
def test_two_first_runs_of_an_installed_msahl_compile_side_by_side(installed, tmp_path):
    """Nothing is compiled yet: neither may disturb what the other keeps."""
    words = ["run", SINGLE, "--t-final", "0.1", "-o"]
    kept = {"NUMBA_CACHE_DIR": str(tmp_path / "c")}
    running = [call_installed(installed, tmp_path, [*words, f"out{n}"], **kept) for n in "12"]
    for one in running:
        told = one.communicate()[1]
        assert one.returncode == 0, told
        assert "50 steps to t = 0.1 s" in told
    tables = [(tmp_path / f"out{n}" / "states.csv").read_bytes() for n in "12"]
    assert tables[0] == tables[1]
    assert list((tmp_path / "c").rglob("msahl.schemes.midpoint.newton.take_steps-*"))
