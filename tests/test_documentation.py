"""The documentation names files, functions and options that exist, in the project's words."""

import ast
import importlib.util
import inspect
import re
import shutil
import subprocess
import sys
from pathlib import Path

import click
import pytest

from msahl.formulations.absolute import rigid_body
from msahl.joints.registry import KINDS
from msahl.laws.registry import COORDINATE_LAWS, POINT_LAWS
from msahl.ports import coordinate, point
from tests.support.guide import section
from tests.support.models import ROOT
from tools.docs.docstrings import MARK, insert_docstrings, modules

PAGES = [
    ROOT / "README.md",
    ROOT / "CONTRIBUTING.md",
    *sorted((ROOT / "docs").glob("*.md")),
    ROOT / "benchmarks" / "README.md",
]


ADDED = {"point_on_cylinder", "viscous", "viscous_drag", "cogging", "ball", "gyrostat", "rotors"}
"""Files that a reader of the guide to new elements makes."""


def listed_files(text):
    """Paths in code marks that look like files of the repository."""
    for path in re.findall(r"`([\w./-]+\.(?:py|xsd|xml))`", text):
        added = Path(path).stem in ADDED or path.startswith("DIR/")
        if "/" in path and not added:
            yield path


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_files_named_in_a_page_exist(page):
    folders = [ROOT, ROOT / "msahl", *(each.parent for each in (ROOT / "msahl").rglob("*.py"))]
    missing = [
        path
        for path in listed_files(page.read_text())
        if not any((folder / path).exists() for folder in folders)
    ]
    assert missing == []


PACKAGE = ROOT / "msahl"
PACKAGES = {path.name for path in PACKAGE.iterdir() if path.is_dir()} - {"start"}
"""Packages of msahl; ``start`` is also what kernels call a workspace."""


SUFFIXES = (".csv", ".json", ".html", ".part")
"""Ends of the names of files that runs write."""


def named_places(path):
    """The places in packages, such as ``system.state``, that docstrings of a module name."""
    tree = ast.parse(path.read_text())
    texts = [n.value for n in ast.walk(tree) if isinstance(n, ast.Constant)]
    for text in filter(lambda text: isinstance(text, str), texts):
        for place in re.findall(r"``(?:msahl\.)?([a-z_]+(?:\.\w+)+)(?:\(\))?``", text):
            if place.partition(".")[0] in PACKAGES and not place.endswith(SUFFIXES):
                yield place


def exists(place):
    """Whether a module of a package, or a name in one, is there; subpackages may be omitted."""
    head, *names = place.split(".")
    for path in (PACKAGE / head).rglob("*.py"):
        known = (*path.relative_to(PACKAGE).parts, path.stem)
        left = [name for name in names if name not in known]
        if not left or (left == names[-1:] and re.search(rf"\b{left[0]}\b", path.read_text())):
            return True
    return False


def test_modules_that_docstrings_name_exist():
    missing = [
        f"{path.relative_to(ROOT)}: {place}"
        for path in sorted(PACKAGE.rglob("*.py"))
        for place in named_places(path)
        if not exists(place)
    ]
    assert missing == []
    assert exists("analysis.equilibria.begin")
    assert not exists("system.reduce")
    assert not exists("system.state.no_such_name")


def functions_of(heading):
    """Functions that the tables of a section of the guide name in their first column."""
    cells = re.findall(r"^ *\| (`[^|]+) \|", section(heading), re.M)
    return [name for cell in cells for name in re.findall(r"`(\w+)`", cell)]


@pytest.mark.parametrize(
    ("heading", "module"),
    [
        ("Adding a force", point),
        ("Adding a force along a coordinate", coordinate),
        ("Adding a kind of body with inertia of its own", rigid_body),
    ],
)
def test_the_guide_names_the_functions_of_an_element(heading, module):
    names = functions_of(heading)
    assert len(names) >= 8
    assert [name for name in names if not hasattr(module, name)] == []


def test_the_theory_has_every_law_by_its_docstring():
    theory = (ROOT / "docs" / "theory.md").read_text()
    asked = {path for match in MARK.finditer(theory) for path in modules(match[1])}
    laws = [law.load for law in POINT_LAWS.values()]
    laws += [law.potential for law in COORDINATE_LAWS.values() if law.is_elastic]
    laws += [law.resistance for law in COORDINATE_LAWS.values() if not law.is_elastic]
    laws += [kind.equations for kind in KINDS.values()]
    assert {Path(inspect.getfile(law)) for law in laws} <= asked
    page = insert_docstrings(theory)
    assert "F = -c |V| V" in page
    assert "coincide, parallel axes" in page
    assert "F = -c |V| V" not in theory  # it stands beside the code alone


def test_the_readme_is_short():
    assert len((ROOT / "README.md").read_text().splitlines()) <= 150


FOREIGN = {
    *("--nthreads", "--nworkers", "--port", "--scheduler-file"),  # of Dask
    *("--array", "--cpus-per-task", "--ntasks", "--time"),  # of SLURM
    *("--sshloginfile", "--workdir"),  # of GNU parallel
}
"""Options of other programs that the pages call."""


def test_options_in_the_documentation_exist():
    from msahl.cli.main import main as msahl
    from msahl.post.cli import main as msahl_post

    known = {"--help", "--quick", "--problem", "--code", "--page", "--planar", "--no-deps"}
    known |= FOREIGN
    for group in (msahl, msahl_post):
        context = click.Context(group)
        for command in [
            group,
            *(group.get_command(context, n) for n in group.list_commands(context)),
        ]:
            parts = command.commands.values() if isinstance(command, click.Group) else ()
            for parameter in (p for one in (command, *parts) for p in one.params):
                known.update(parameter.opts)
    for page in PAGES:
        text = page.read_text()
        used = set(re.findall(r"(?<![\w-])--[a-z][a-z-]+", text))
        assert used <= known, page.name


def load_tool(name):
    spec = importlib.util.spec_from_file_location(name, ROOT / "tools" / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    monkey = sys.modules.setdefault(name, module)
    spec.loader.exec_module(monkey)
    return monkey


@pytest.mark.parametrize(
    ("line", "word"),
    [
        ("islandRateMax = 1", "island"),
        ("the gap of a contact", None),
        ("def turn_of(b):", "turn"),
        ("What is left out", "left out"),
        ("return the number of degrees of freedom", None),
        ("return it in turn", None),
        ("    return whole numbers", None),
    ],
)
def test_the_check_of_words_reads_prose_and_identifiers(line, word):
    findings = [found for found, _ in load_tool("check_words").findings_of("msahl/x.py", "", line)]
    assert (word in findings) if word else findings == []


def test_a_phrase_over_two_lines_is_read_as_one():
    check = load_tool("check_words")
    assert list(check.findings_of("docs/x.md", "the number of degrees of", "freedom is 1")) == []
    assert [w for w, _ in check.findings_of("docs/x.md", "it is left", "out of it")] == ["left out"]


@pytest.mark.parametrize("in_git", [True, False])
def test_the_check_of_words_exits_with_findings(tmp_path, in_git):
    if in_git and not shutil.which("git"):
        pytest.skip("git is not installed; the case without it is tested")
    if in_git:
        subprocess.run(["git", "init", "-q"], cwd=tmp_path, check=True)
    (tmp_path / ".gitignore").write_text("/built/\n__pycache__/\n")
    for name in ("page.md", "pages/page.md", "built/page.md", "pages/__pycache__/page.md"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("One island.\n")
    command = [sys.executable, str(ROOT / "tools" / "check_words.py"), "--root", str(tmp_path)]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    assert result.returncode == 1
    assert [line.split(": write ")[0] for line in result.stdout.splitlines()] == [
        "page.md:1: 'island'",
        "pages/page.md:1: 'island'",
    ]
