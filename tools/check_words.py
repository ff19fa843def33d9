"""Find words in the repository that the project replaced by the field's terms.

Usage: python tools/check_words.py [--count] [--root FOLDER] [PATH...]

Every line of every tracked text (Python, Markdown, XML, XSD, TOML, YAML, Makefile, the header of a
CSV table) is compared with ``TERMS``: prose, comments, docstrings, messages and identifiers alike.
Identifiers are split into words first, so ``gapRateMax`` and ``gap_rate`` both read "gap rate".
Each finding is printed as file:line with the term to write instead. Exit status 1 if there is one.

The terms are those of Exudyn, Chrono, Drake, MuJoCo, MBSim and SciPy, where these agree.
docs/glossary.md says what each term means.
"""

import argparse
import os
import re
import shutil
import subprocess
import sys
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from fnmatch import fnmatch
from itertools import pairwise
from pathlib import Path

ROOT = Path(__file__).parents[1]
SUFFIXES = {".py", ".md", ".xml", ".xsd", ".toml", ".yml", ".yaml", ".cff", ".sh", ".css"}
NAMES = {"Makefile", "run"}


@dataclass(frozen=True, slots=True)
class Term:
    """A word or phrase (regular expression on words in lower case) and what to write instead."""

    pattern: str
    instead: str
    # Phrases that contain the word in another, ordinary sense.
    allowed: str = ""


TERMS = (
    Term(
        r"turn(s|ed|ing)?",
        "rotation, rotation increment, rotate, revolution",
        allowed=r"in turn\b|turn(s|ed|ing)? (on|off|out|into|back|to)\b|turning points?",
    ),
    Term(
        r"joints? (are |were )?(closed|open|opened|opens|part|kept) (at up )?to",
        "constraint violation",
    ),
    Term(r"joints part", "constraint violation (velocity level)"),
    Term(
        r"(at|of|between|from) the rows?|rows? s (own )?times?|rows between|at rows", "output times"
    ),
    Term(r"units? of round.?off|round.?offs", "machine epsilons"),
    Term(
        r"(its|the|their|longest|largest|whole|of the|s) ways?|ways? max|way max",
        "displacement",
        allowed=r"the (same |only |other |usual |best )?way (to|that|it|they|in which)\b"
        r"|the same way",
    ),
    Term(r"free motions?", "degrees of freedom"),
    Term(r"joints? keeps?|keeps? open", "constrains"),
    Term(r"freedoms?", "degree of freedom, coordinate", allowed=r"degrees? of freedom"),
    Term(
        r"(hold|holds|held) (at|up to)|method holds?|runs? (hold|holds)|that hold|hold with",
        "stable, completes",
    ),
    Term(r"(leaves?|leaving|left) (\w+ )?out", "omits; default; model reductions"),
    Term(r"islands?", "independent subsystems"),
    Term(r"joint rows?|rows? of joints?|row law", "constraint equation"),
    Term(
        r"shadow(s|ed)?",
        "companion run, reference run",
        # Schaub's name of the second set of parameters of the same orientation.
        allowed=r"shadow (set|parameters)",
    ),
    Term(r"paces?|paced", "step-size control"),
    Term(r"culprits?", "worst residual; element with a NaN"),
    Term(r"halvings?|in halves|in \d+ parts", "step subdivisions (substeps)"),
    Term(
        r"spread (over|of)( the| their| its)?( jacobian s)? pivots?|pivots? spread", "pivot ratio"
    ),
    Term(r"tells|(is|are|was|were) told|knows|what separates", "say what it computes"),
    Term(r"dearest", "most expensive"),
    Term(r"quicke(r|st)", "faster, fastest"),
    Term(r"whole", "complete", allowed=r"whole numbers?|(as a|on the) whole"),
    Term(r"rooms?|guests?|houses?|desks?", "say what it is (workspace, module)"),
    Term(r"foresight", "prediction"),
)


@dataclass(frozen=True, slots=True)
class Allowance:
    """Lines that may hold a word of the list, and why."""

    files: str
    line: str
    reason: str


EXCEPTIONS = (
    Allowance("tools/check_words.py", "", "the list itself"),
    Allowance("tests/test_documentation.py", "", "the test of the list"),
    Allowance("msahl/post/web/*.css", r"\bbox-shadow: ", "a property of CSS"),
)

Entry = tuple[re.Pattern[str], re.Pattern[str] | None, Term]

COMPILED: list[Entry] = [
    (
        re.compile(rf"\b(?:{term.pattern})\b"),
        re.compile(rf"\b(?:{term.allowed})\b") if term.allowed else None,
        term,
    )
    for term in TERMS
]


def in_words(line: str) -> str:
    """Return the line in lower case with identifiers split into their words."""
    line = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", " ", line)
    return re.sub(r"[_\W]+", " ", line).lower()


def findings_in(path: str, lines: list[str]) -> Iterator[tuple[int, str, str]]:
    """Yield the number of each line that holds a word of the list, the word, and the term to write
    instead. The file's name is a text, too: line 0.
    """
    words = in_words("\n".join([path, *lines]))
    sought = [entry for entry in COMPILED if entry[0].search(words)]
    if sought:
        for number, (before, line) in enumerate([("", path), *pairwise(["", *lines])]):
            for word, instead in findings_of(path, before, line, sought):
                yield number, word, instead


def findings_of(
    path: str, before: str, line: str, sought: Sequence[Entry] = COMPILED
) -> Iterator[tuple[str, str]]:
    """Yield each word of those ``sought`` that a line holds, with the term to write instead.

    Phrases may begin in the line ``before``.
    """
    tail = " ".join(in_words(before).split()[-3:]) + " "
    words = tail + in_words(line)
    for pattern, allowed, term in sought:
        text = allowed.sub(lambda match: "." * len(match[0]), words) if allowed else words
        for found in pattern.finditer(text):
            if found.end() > len(tail) and not is_exception(path, line):
                yield found[0], term.instead
                break


def is_exception(path: str, line: str) -> bool:
    """Return whether a line of the file is among the exceptions."""
    return any(fnmatch(path, e.files) and re.search(e.line, line) for e in EXCEPTIONS)


def tracked(root: Path, paths: Iterable[str]) -> list[str]:
    """Return the files of a checkout that git does not ignore."""
    listed = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard", "--", *paths],
        cwd=root,
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    return list(filter(None, listed.split("\0")))


def unpacked(root: Path, paths: list[str]) -> Iterator[str]:
    """Yield the files of an unpacked archive that its ``.gitignore`` does not list."""
    listed = root / ".gitignore"
    patterns = listed.read_text().split() if listed.exists() else []

    def kept(path: str) -> bool:
        name = Path(path).name
        return not any(fnmatch(path if p[0] == "/" else name, p.strip("/")) for p in patterns)

    for folder, folders, files in os.walk(root):
        here = Path(folder).relative_to(root)
        folders[:] = sorted(name for name in folders if kept((here / name).as_posix()))
        for path in [here / name for name in sorted(files)]:
            chosen = not paths or any(path.is_relative_to(each) for each in paths)
            if chosen and kept(path.as_posix()):
                yield path.as_posix()


def texts(root: Path, paths: list[str]) -> Iterator[tuple[str, list[str]]]:
    """Yield the tracked texts with their lines; of a CSV table the header alone."""
    in_git = (root / ".git").exists() and shutil.which("git")
    for name in tracked(root, paths) if in_git else unpacked(root, paths):
        path = root / name
        if not path.is_file():
            continue
        if path.suffix in SUFFIXES or path.name in NAMES:
            yield name, path.read_text(encoding="utf-8", errors="replace").splitlines()
        elif path.suffix == ".csv":
            with path.open(encoding="utf-8", errors="replace") as file:
                yield name, [file.readline()]


def main() -> int:
    """Print the findings, or their number by folder."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--count", action="store_true", help="print the number of findings by folder"
    )
    parser.add_argument("--root", type=Path, default=ROOT, help="checkout to look at")
    parser.add_argument("paths", nargs="*", help="files or folders (default: all tracked files)")
    arguments = parser.parse_args()
    counts: Counter[str] = Counter()
    for name, lines in texts(arguments.root, arguments.paths):
        for number, word, instead in findings_in(name, lines):
            counts[str(Path(name).parent)] += 1
            if not arguments.count:
                print(f"{name}:{number}: '{word}': write {instead}")
    if arguments.count:
        for folder, count in sorted(counts.items()):
            print(f"{count:5d}  {folder}")
    if counts:
        print(f"{counts.total()} findings", file=sys.stderr)
    return 1 if counts else 0


if __name__ == "__main__":
    sys.exit(main())
