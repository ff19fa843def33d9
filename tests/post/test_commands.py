"""The command msahl-post: exit statuses, files, and what it does not load."""

import re
import subprocess
import sys
from html import unescape

import pytest
from click.testing import CliRunner

from msahl.post.cli import main
from tests.support.run_folders import DT, conical_rows, write

INFO = {
    "msahl": "0.1.0",
    "deck": {"path": "cone_|_*.xml", "digest": "ab" * 32},
    "options": {"dt": DT, "every": 1, "scheme": "preserving", "solver": "root"},
    "status": "completed",
    "message": "",
    "steps": 40,
    "unknowns": 9,
    "warnings": ["initial velocities were <changed>"],
    "seconds": {"loop": 0.25},
}


@pytest.fixture
def run(tmp_path):
    write(tmp_path / "run", info=INFO)
    return tmp_path / "run"


@pytest.fixture(scope="module")
def reported(tmp_path_factory):
    """The folder of a run with its report, and what the command said."""
    folder = tmp_path_factory.mktemp("reported") / "run"
    write(folder, info=INFO)
    return folder, call("report", folder)


def call(*words):
    return CliRunner().invoke(main, [str(word) for word in words])


@pytest.mark.parametrize("command", ["energy", "work", "constraints"])
def test_tables(run, command):
    result = call(command, run, run)
    assert result.exit_code == 0
    assert len(result.stdout.splitlines()) == 4  # groups, headers, two runs
    assert call(command, run, "--json").stdout.startswith("[")
    assert call(command, run, "--csv").stdout.startswith("run,")


def test_a_partial_and_a_thinned_run_say_so(tmp_path):
    write(tmp_path / "part", complete=False)
    states, reactions = conical_rows()
    info = {**INFO, "options": {"every": 4}}
    write(tmp_path / "thin", states[::4], reactions[::4], info=info)
    result = call("work", tmp_path / "part", tmp_path / "thin")
    assert result.exit_code == 0
    assert "part: the run is incomplete (killed, results to t = 0.4 s of 0.4 s)" in result.stderr
    assert "thin: virtual work is not available: only one of 4 steps" in result.stderr
    assert call("plot", tmp_path / "thin", "work", "-o", tmp_path).exit_code == 2


@pytest.mark.slow
def test_plot_writes_what_it_says(run, tmp_path):
    words = ("--format", "png", "--format", "svg", "-o", tmp_path / "pictures")
    result = call("plot", run, *words)
    assert result.exit_code == 0
    names = {line.rpartition("/")[2] for line in result.stdout.splitlines()}
    kinds = ("linkage", "path-xy", "positions", "energy", "work", "constraints", "reactions")
    assert names == {f"{kind}.{form}" for kind in kinds for form in ("png", "svg")}
    first = {path.name: path.read_bytes() for path in (tmp_path / "pictures").iterdir()}
    assert first.keys() == names
    call("plot", run, "energy", *words)
    assert {path.name: path.read_bytes() for path in (tmp_path / "pictures").iterdir()} == first
    assert b"<dc:date>" not in first["energy.svg"]


def test_plot_of_one_kind_and_body(run):
    result = call("plot", run, "path", "--plane", "zx", "--body", "Bob")
    assert result.stdout.strip() == str(run / "plots" / "path-zx.png")
    result = call("plot", run, "--joint", "Elbow")
    assert result.exit_code == 2
    assert result.stderr == "msahl-post: no joint 'Elbow' in the model (it has: Pivot)\n"


@pytest.mark.slow
def test_report_holds_everything(reported):
    run, result = reported
    assert result.exit_code == 0
    assert result.stdout.split() == [
        str(run / "report" / f"report.{form}") for form in ("md", "html")
    ]
    html = (run / "report" / "report.html").read_text()
    assert "http" not in html.split("<body>")[1].split("<script")[0]
    sources = re.findall(r'(?:src|href)="([^"]{0,22})', html)
    assert all(source.startswith("#") for source in sources)  # within the picture itself
    assert "Conical &amp; &lt;calm&gt;" in html
    assert "initial velocities were &lt;changed&gt;" in html
    text = (run / "report" / "report.md").read_text()
    assert "| deck | cone\\_\\|\\_\\*.xml |" in text
    assert "of the largest kinetic energy" in text
    pictures = re.findall(r"\]\((.*?)\)", text)
    kinds = ("linkage", "path-xy", "positions", "reactions", "energy", "constraints", "work")
    assert {name.removesuffix(".png") for name in pictures} == set(kinds)
    for picture in pictures:
        assert (run / "report" / picture).read_bytes().startswith(b"\x89PNG")


def test_both_files_of_a_report_have_the_same_sections_tables_and_graphs(reported):
    run, _ = reported
    html, text = ((run / "report" / f"report.{form}").read_text() for form in ("html", "md"))
    titles = list(map(unescape, re.findall(r"<(?:h[1-4]|summary)>(.*?)</", html)))
    graphs = [title for title in titles if title.endswith("]")]  # axes of the pictures
    headings = re.sub(r"\\(.)", r"\1", "\n".join(re.findall(r"^#+ (.*)$", text, re.MULTILINE)))
    assert [title for title in titles if title not in graphs] == headings.splitlines()
    assert len(graphs) == 13
    rules = re.findall(r"^(\| ---?[-: |]*)$", text, re.MULTILINE)
    assert html.count("<table>") == len(rules) == 6


def test_compare_reports_by_its_status(run, tmp_path):
    write(tmp_path / "reference")
    assert call("compare", run, tmp_path / "reference").exit_code == 0
    states, reactions = conical_rows()
    states[7, 3] += 1e-4
    write(tmp_path / "reference", states, reactions)
    result = call("compare", run, tmp_path / "reference")
    assert result.exit_code == 1
    assert "worst: t = 0.07 s, Bob.z:" in result.stdout
    assert call("compare", run, tmp_path / "reference", "--columns", "Bob.x, *.Fz").exit_code == 0
    assert call("compare", run, tmp_path / "reference", "--until", "0.06").exit_code == 0
    assert call("compare", run, tmp_path / "reference", "--atol", "1e-3").exit_code == 0
    result = call("compare", run / "states.csv", run / "reactions.csv")
    assert result.exit_code == 2
    assert result.stderr.startswith("msahl-post: reactions.csv: different columns")


@pytest.mark.parametrize("command", ["energy", "plot", "report"])
def test_a_wrong_folder_is_one_clear_line(tmp_path, command):
    result = call(command, tmp_path)
    assert result.exit_code == 2
    assert result.stderr == (
        f"msahl-post: {tmp_path}: not the folder of a run (no deck.xml); make one: msahl run\n"
    )
    (tmp_path / "deck.xml").write_text("<data/>")
    result = call(command, tmp_path)
    assert result.exit_code == 2
    assert result.stderr.count("\n") == 1
    assert "deck.xml" in result.stderr


@pytest.mark.slow
def test_tables_do_without_matplotlib(run):
    script = (
        "import sys; from msahl.post.cli import main; "
        f"main(['energy', {str(run)!r}], standalone_mode=False); "
        "assert 'matplotlib' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", script], check=True, capture_output=True)
