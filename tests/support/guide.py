"""The listings of the guides in docs, and a copy of the program that they are added to."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGES = ("adding-an-element", "adding-a-joint", "adding-a-force")
PAGE = "".join((ROOT / "docs" / f"{name}.md").read_text() for name in PAGES)

ONE_AFTER_ANOTHER = """
import shlex, sys, traceback
from click.testing import CliRunner
from msahl.cli.main import main
from msahl.post.cli import main as post
for command in sys.argv[1:]:
    program, *words = shlex.split(command)
    result = CliRunner().invoke({"msahl": main, "msahl-post": post}[program], words)
    if result.exit_code:
        traceback.print_exception(result.exception)
        sys.exit(f"{command}: {result.output}")
"""


def section(heading):
    """The text of a section of the guide."""
    parts = re.split(r"^## ", PAGE, flags=re.M)
    (text,) = [part for part in parts if part.startswith(f"{heading}\n")]
    return text


def listings(text, language):
    """The listings of a section in one language."""
    return re.findall(rf"```{language}\n(.*?)```", text, re.DOTALL)


def copy_program(root, *others):
    """Copy the package with what is installed in it, and the folders ``others``, to ``root``: with
    compiled Python files, which remain valid, since the times of files are kept.
    """
    for name in ("msahl", "schemas", *others):
        shutil.copytree(ROOT / name, root / name, symlinks=True)
    (root / "msahl" / "schemas").symlink_to("../schemas")


def apply(root, changes):
    """Change the files of ``root`` as a listing with lines to add and to remove says."""
    path, *hunks = re.split(r"^@@\n", changes, flags=re.M)
    file = root / path.removeprefix("--- ").strip()
    for hunk in hunks:
        lines = hunk.splitlines(keepends=True)
        old = "".join(line[1:] or "\n" for line in lines if not line.startswith("+"))
        new = "".join(line[1:] or "\n" for line in lines if not line.startswith("-"))
        text = "\n" + file.read_text()
        assert text.count("\n" + old) == 1, f"{file.name} does not have once:\n{old}"
        file.write_text(text.replace("\n" + old, "\n" + new)[1:])


def call(root, *arguments):
    """``msahl`` of the copy, in plain Python: nothing is compiled for an element of a test."""
    program = "import sys; from msahl.cli.main import main; main(sys.argv[1:])"
    return python(root, "-c", program, *arguments)


def call_all(root, *commands):
    """Commands of the copy, ``msahl`` or ``msahl-post`` with their words, one after another in one
    process, each of which must succeed.
    """
    result = python(root, "-c", ONE_AFTER_ANOTHER, *commands)
    assert result.returncode == 0, result.stdout[-2000:] + result.stderr[-2000:]


def run_tests(root, *arguments):
    """Tests of the copy, in plain Python."""
    return python(root, "-m", "pytest", "-q", "-p", "no:cacheprovider", *arguments)


def python(root, *arguments):
    """Python with the copy, uncompiled, as a command line."""
    environment = os.environ | {"NUMBA_DISABLE_JIT": "1", "PYTHONPATH": str(root)}
    command = [sys.executable, "-P", *arguments]
    return subprocess.run(
        command, cwd=root, env=environment, capture_output=True, text=True, check=False
    )
