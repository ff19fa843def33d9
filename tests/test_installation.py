"""Every way to install msahl gives a program that runs a deck, and the first pages hold as written.

Each installation has a fresh environment, filled by pip from the index of packages. They find the
kernels of the tests, since their sources are equal; that an installed msahl compiles its own is
shown by tests/cli/test_commands.py.
"""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from msahl.jit.files import PORTABLE
from tests.support.models import ROOT
from tools.build_wheel import copy_sources

pytestmark = pytest.mark.slow
PAGES = ("README.md", "docs/getting-started.md")
SKIPPED = {"make test": "would run this test"}
COMMANDS = {"python3", ".", "pip", "make", "msahl", "msahl-post"}
"""First words of commands; all other indented blocks show what a command prints."""
RUN = "msahl new pendulum -o pendulum.xml\nmsahl run pendulum.xml --t-final 1\n"
SECONDS = 900
"""Time limit for the commands of a page, which install packages and compile kernels."""


def blocks(text):
    """Blocks of code in a page: the language, empty if the block is indented, and the lines."""
    pattern = r"^```(\w+)\n(.*?)^```$|(?<=\n\n)((?:    [^\n]+\n)+)"
    for language, fenced, indented in re.findall(pattern, text, re.M | re.S):
        yield language, fenced or re.sub(r"^    ", "", indented, flags=re.M)


def is_command(line):
    return line.split()[0] in COMMANDS


def script(text):
    """What a reader of the page types and saves, as one shell script."""
    parts = []
    for number, (language, block) in enumerate(blocks(text)):
        if language == "xml":
            parts.append(f"cat > pendulum.xml <<'END'\n{block}END\n")
        elif language:
            name = f"page{number}.py"
            parts.append(f"cat > {name} <<'END'\n{block}END\npython {name}\n")
        elif is_command(block):
            assert all(map(is_command, block.splitlines())), block
            kept = [line for line in block.splitlines() if not line.startswith(tuple(SKIPPED))]
            parts.append("\n".join([*kept, ""]))
    return "".join(parts)


def without_numbers(text):
    return " ".join(re.sub(r"\d[\d.e+-]*", "#", text).split())


def shown(text):
    """What the page shows of the printed text, in pieces between dots."""
    for language, block in blocks(text):
        if not language and not is_command(block):
            yield from without_numbers(block).split(" ...")


def execute(commands, folder, path=()):
    """What the shell commands print; fails at the first that fails."""
    foreign = {"PYTHONPATH", "VIRTUAL_ENV", "NUMBA_DISABLE_JIT", "MAKEFLAGS", "MFLAGS", "MAKELEVEL"}
    environment = {name: value for name, value in os.environ.items() if name not in foreign}
    found = [*map(str, path), str(Path(sys.base_prefix) / "bin"), environment["PATH"]]
    # What is not imported need not be translated to bytecode: half of pip's time.
    environment["PIP_NO_COMPILE"] = "1"
    environment["PATH"] = os.pathsep.join(found)
    result = subprocess.run(
        ["bash", "-exc", commands], cwd=folder, env=environment, text=True, timeout=SECONDS,
        stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=False,
    )  # fmt: skip
    assert result.returncode == 0, result.stdout[-3000:]
    return result.stdout


@pytest.fixture
def folder(tmp_path):
    """A folder that is removed: an environment takes 700 MB."""
    yield tmp_path / "msahl"
    shutil.rmtree(tmp_path, ignore_errors=True)


@pytest.mark.parametrize("page", PAGES)
def test_the_page_has_commands(page):
    text = (ROOT / page).read_text()
    assert script(text).count("\nmsahl") >= 2
    assert all(name in (ROOT / "README.md").read_text() for name in SKIPPED)


@pytest.mark.parametrize("page", PAGES)
def test_commands_of_the_page_run_as_written(page, folder):
    """The README installs an editable copy (``make run``), Getting started the sources."""
    copy_sources(folder)
    shutil.copy(ROOT / "Makefile", folder)
    text = (ROOT / page).read_text()
    printed = without_numbers(execute(script(text), folder, [folder / ".venv" / "bin"]))
    assert [piece for piece in shown(text) if piece not in printed] == []


def test_a_source_distribution_runs_a_deck(folder):
    copy_sources(folder)
    commands = (
        "python3 -m venv .venv\n.venv/bin/pip install -q build\n.venv/bin/python -m build -s\n"
        "rm -r msahl decks schemas\npip install -q dist/*.tar.gz\n"
    )
    execute(commands + RUN, folder, [folder / ".venv" / "bin"])


@pytest.mark.skipif(sys.platform != "linux", reason="the wheel is for Linux")
def test_a_platform_wheel_runs_a_deck_without_numba(folder):
    """The wheel has the kernels of one deck only: all of them take minutes to compile."""
    folder.mkdir()
    deck = ROOT / "msahl" / "deck" / "templates" / "pendulum.xml"
    build = [sys.executable, "-m", "tools.build_wheel", "-o", folder, deck]
    subprocess.run(build, cwd=ROOT, check=True)
    install = "python3 -m venv .venv\npip install -q *.whl\n! python -c 'import numba'\n"
    own = f"export NUMBA_CACHE_DIR={folder / 'kernels'}\n"
    execute(install + own + RUN, folder, [folder / ".venv" / "bin"])
    kept = [path.name for path in (folder / "kernels").rglob("*") if path.is_file()]
    assert all(name.startswith("sources-") for name in kept)  # digests, no code was compiled
    (package,) = folder.glob(".venv/lib/*/site-packages/msahl/kernels")
    assert sorted(path.name for path in package.iterdir()) == sorted(PORTABLE)
