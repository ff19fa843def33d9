"""Add the generated pages to the documentation site: a hook of MkDocs.

Generated are the examples (from the headers of the decks), the commands (from their help) and one
API page per package (from the docstrings). Each says from what it was made; none is kept in the
repository. Pages outside docs/ (benchmarks, CHANGELOG.md, CONTRIBUTING.md) are added as they are.
Links are written for a browser of the repository; here they are rewritten for the site.
"""

import html
import posixpath
import re
import sys
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path

import click
from lxml import etree
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ROOT = Path(__file__).parents[2]
FAMILIES = {
    "basics": ("Basics", "One body, few forces: what a deck looks like and how results read."),
    "joints": ("Joints", "One deck for every kind of joint and coupling."),
    "forces": ("Forces and motions", "One deck for every kind of load and prescribed motion."),
    "contact": ("Contact", "Impacts, ropes and stops: what opens and closes."),
    "mechanisms": ("Mechanisms", "Linkages, gyroscopes, cams and regulators."),
    "elastic": ("Elastic bodies", "Beams: large displacements, vibrations, rotors, a cable."),
    "machines": ("Machines", "Motors, sensors and controllers: actuators, signals and states."),
    "thesis": ("Thesis", "The models of A. D. Hainge's thesis (2010)."),
    "extreme": ("Extreme models", "Models that make integrators fail: stiff, light, long, fast."),
}
# Files outside docs/ that the site shows, with the pictures they use.
OUTSIDE = (
    "CHANGELOG.md",
    "CONTRIBUTING.md",
    "benchmarks/README.md",
    *sorted(f"benchmarks/results/{path.name}" for path in ROOT.glob("benchmarks/results/*.md")),
)
LINK = re.compile(r"(\]\()([^)\s:#]+)(#[^)\s]*)?(\))")


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """List the pages of the packages in the navigation."""
    pages = [{package_name(package): f"api/{package_name(package)}.md"} for package in packages()]
    config.nav = [*(config.nav or []), {"API": ["api/index.md", *pages]}]
    return config


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add every generated page and every file from outside docs/."""
    pages = {**example_pages(), **api_pages(), "commands.md": commands_page()}
    for uri, text in pages.items():
        files.append(File.generated(config, uri, content=text))
    for uri, content in player_files().items():
        files.append(File.generated(config, uri, content=content))
    others = sorted(
        path.relative_to(ROOT).as_posix()
        for pattern in ("benchmarks/results/*.png", "examples/*.*")
        for path in ROOT.glob(pattern)
    )
    for uri in [*OUTSIDE, *others]:
        if (ROOT / uri).exists():
            files.append(File.generated(config, uri, abs_src_path=str(ROOT / uri)))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Insert docstrings, and lead the links, which hold in the repository, to pages of the site."""
    uri = page.file.src_uri
    outside = uri in OUTSIDE
    folder = posixpath.dirname(uri if outside else f"docs/{uri}")

    def lead(match: re.Match[str]) -> str:
        start, target, anchor, end = match.groups()
        path = posixpath.normpath(posixpath.join(folder, target))
        site = path.removeprefix("docs/")
        if path.startswith("decks/") and path.endswith(".xml"):
            _, family, name = path.split("/")
            site, anchor = f"examples/{family}.md", f"#{Path(name).stem}"
        if path.startswith("msahl/") and path.endswith(".py"):
            module = path.removesuffix(".py").replace("/", ".")
            site, anchor = f"api/{module.rpartition('.')[0]}.md", f"#{module}"
        if files.get_file_from_path(site) is None:
            return match[0]
        return start + posixpath.relpath(site, posixpath.dirname(uri) or ".") + (anchor or "") + end

    sys.path.insert(0, str(ROOT))
    from tools.docs.docstrings import insert_docstrings

    return LINK.sub(lead, insert_docstrings(markdown))


def example_pages() -> dict[str, str]:
    """Return the pages of the decks by path: one a folder of decks/, and the list of all."""
    pages = {}
    index = ["# Examples\n", generated("the headers of decks/"), EXAMPLES_INTRODUCTION]
    for family, (title, summary) in FAMILIES.items():
        decks = sorted((ROOT / "decks" / family).glob("*.xml"))
        text = [f"# {title}\n", generated(f"the headers of decks/{family}/"), f"{summary}\n"]
        text += [example(family, path, deck_header(path)) for path in decks]
        pages[f"examples/{family}.md"] = "\n".join(text)
        index.append(f"## {title}\n\n{summary} [All of them]({family}.md)\n")
        index.append(gallery(family, decks))
    pages["examples/index.md"] = "\n".join(index)
    return pages


EXAMPLES_INTRODUCTION = """
A click on a picture plays the motion, which can be rotated and stopped; a name leads to the deck
with what it shows and what to expect. A test runs each deck and compares the result with that. Run
one, and write a report with pictures:

    msahl run decks/mechanisms/four_bar.xml
    msahl-post report results/four_bar

The second picture of a deck shows its linkage at a few instants (light to dark: early to late) with
the paths of the mass centres; where little moves, or along a line only, displacements or velocities
against time.
"""


def gallery(family: str, decks: Sequence[Path]) -> str:
    """Return the pictures of decks, each with its name; a click plays the motion."""
    cards = [
        f'<figure>{playable(family, path)}<figcaption><a href="{family}.html#{path.stem}">'
        f"{html.escape(deck_title(path))}</a></figcaption></figure>"
        for path in decks
    ]
    return '<div class="gallery">\n' + "\n".join(cards) + "\n</div>\n"


def playable(family: str, path: Path) -> str:
    """Return the picture of what the viewer shows of a deck, with the link that plays its motion;
    its title if it has no picture."""
    title, name = html.escape(deck_title(path), quote=True), f"{family}/{path.stem}"
    if not (ROOT / "docs" / "examples" / "thumbs" / f"{name}.webp").exists():
        return f'<span class="no-picture">{title}</span>'
    return (
        f'<a class="play" href="view.html?{name}" title="Play {title}">'
        f'<img src="thumbs/{name}.webp" alt="{title}" width="400" height="280" loading="lazy"></a>'
    )


@cache
def deck_title(path: Path) -> str:
    """Return the title of a deck; where others of its folder have the same, the first sentence of
    its header."""
    own = _own_title(path)
    others = (other for other in path.parent.glob("*.xml") if other != path)
    if own and own not in map(_own_title, others):
        return own
    found = re.search(r"<!--\s*(.*?)\.?\s*\n\s*\n", path.read_text(encoding="utf-8"), re.DOTALL)
    return " ".join(found[1].split()) if found else path.stem


@cache
def _own_title(path: Path) -> str:
    return etree.parse(path).findtext(".//simulation/title") or ""


def player_files() -> dict[str, str]:
    """Return the page that plays the motions of the examples, and the motions, by path."""
    sys.path.insert(0, str(ROOT))
    from tools.docs.gallery import MOTIONS, as_script, player_page

    scripts = {
        f"examples/motions/{path.parent.name}/{path.stem}.js": as_script(path.read_text())
        for path in sorted(MOTIONS.glob("*/*.json"))
    }
    return {"examples/view.html": player_page(), **scripts}


def example(family: str, path: Path, paragraphs: list[str]) -> str:
    """Return the section of one deck: title, picture, header, and the deck itself, folded."""
    title = deck_title(path)
    text = [f"## {title} {{ #{path.stem} }}\n"]
    pictures = playable(family, path)
    picture = ROOT / "docs" / "examples" / "pictures" / family / f"{path.stem}.png"
    if picture.exists():
        source = f"pictures/{family}/{path.stem}.png"
        pictures += f'<img src="{source}" alt="{html.escape(title)}: instants" loading="lazy">'
    text.append(f'<div class="example">{pictures}</div>\n')
    text += [f"{paragraph}\n" for paragraph in paragraphs]
    text.append(f"    msahl run decks/{family}/{path.name}\n")
    source = path.read_text(encoding="utf-8").rstrip()
    body = source[source.index("-->") + 3 :].strip() if "-->" in source else source
    text.append(f'<details markdown="1"><summary>{path.name}</summary>\n')
    text.append(f"```xml\n{body}\n```\n\n</details>\n")
    return "\n".join(text)


def deck_header(path: Path) -> list[str]:
    """Return the paragraphs of the comment at the beginning of a deck."""
    found = re.search(r"<!--(.*?)-->", path.read_text(encoding="utf-8"), re.DOTALL)
    blocks = re.split(r"\n\s*\n", found[1].strip()) if found else [path.stem]
    return [escape(" ".join(line.strip() for line in block.splitlines())) for block in blocks]


def escape(text: str) -> str:
    """Return plain text as Markdown that shows it unchanged."""
    return re.sub(r"([\\`*_{}\[\]<>#|])", r"\\\1", text)


def commands_page() -> str:
    """Return the help of every command."""
    sys.path.insert(0, str(ROOT))
    from msahl.cli.main import main as msahl
    from msahl.post.cli import main as msahl_post

    text = ["# Commands\n", generated("the commands' own help (`--help`)")]
    for name, command in (("msahl", msahl), ("msahl-post", msahl_post)):
        text.append(f"## {name}\n\n```text\n{help_of(name, command)}\n```\n")
        for title, part, parent in subcommands(name, command):
            text.append(f"### {title}\n\n```text\n{help_of(part.name or '', part, parent)}\n```\n")
    return "\n".join(text)


def subcommands(
    name: str, command: click.Command
) -> Iterator[tuple[str, click.Command, click.Context]]:
    """Yield the commands of a group with their full names and the group's context."""
    if isinstance(command, click.Group):
        parent = click.Context(command, info_name=name)
        for each in command.list_commands(parent):
            part = command.get_command(parent, each)
            if part is not None:
                yield f"{name} {each}", part, parent


def help_of(name: str, command: click.Command, parent: click.Context | None = None) -> str:
    """Return the help text of a command, 96 columns wide."""
    context = click.Context(command, info_name=name, parent=parent, terminal_width=96)
    context.max_content_width = 96
    return command.get_help(context)


def packages() -> list[Path]:
    """Return the folders of all packages of msahl."""
    return sorted({path.parent for path in (ROOT / "msahl").rglob("*.py")})


def package_name(package: Path) -> str:
    """Return the dotted name of the package in a folder."""
    return ".".join(package.relative_to(ROOT).parts)


def api_pages() -> dict[str, str]:
    """Return a page for every package of msahl, with the documentation of its modules."""
    pages, index = {}, ["# API\n", generated("the docstrings of msahl"), API_INTRODUCTION]
    for package in packages():
        name = package_name(package)
        modules = [path.stem for path in sorted(package.glob("*.py"))]
        names = [name, *(f"{name}.{each}" for each in modules if not each.startswith("__"))]
        body = "\n\n".join(f"::: {each}" for each in names)
        pages[f"api/{name}.md"] = f"# {name}\n\n{generated('docstrings')}\n{body}\n"
        summary = first_line(package / "__init__.py")
        index.append(f"| [{name}]({name}.md) | {escape(summary)} |")
    pages["api/index.md"] = "\n".join(index) + "\n"
    return pages


API_INTRODUCTION = """
Modules by package. What the packages are for and how they depend on each other:
[Architecture](../architecture.md).

| package | contents |
| --- | --- |"""


def first_line(path: Path) -> str:
    """Return the first line of a module's docstring."""
    found = re.match(r'\s*r?"""(.*?)(?:\n|""")', path.read_text(encoding="utf-8"))
    return found[1] if found else ""


def generated(source: str) -> str:
    """Return the note at the top of a generated page."""
    return f"<!-- Generated from {source} by make docs; do not edit. -->\n"
