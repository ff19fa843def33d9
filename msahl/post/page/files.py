"""Write a document as Markdown with its pictures beside it, and as one HTML file."""

from collections.abc import Iterator, Sequence
from pathlib import Path

from msahl.post.document import Banner, Block, Folded, Graphs, OnPage, Picture, as_markdown
from msahl.post.draw import draw_group, encode, style
from msahl.post.page.blocks import as_html
from msahl.results.write import replace_file


def write_document(title: str, blocks: Sequence[Block], folder: Path, stem: str) -> list[Path]:
    """Write ``stem.md``, its pictures and ``stem.html`` to ``folder``; return the two paths.

    The HTML file contains all that it shows.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with style():
        for name, png in pictures_of(blocks):
            replace_file(folder / name, png)
    texts = {f"{stem}.md": as_markdown(blocks), f"{stem}.html": as_html(title, blocks)}
    for name, text in texts.items():
        replace_file(folder / name, text.encode())
    return [folder / name for name in texts]


def pictures_of(blocks: Sequence[Block]) -> Iterator[tuple[str, bytes]]:
    """Yield name and content of the pictures that the Markdown refers to."""
    for block in blocks:
        match block:
            case Picture(name, _, png):
                yield name, png
            case Graphs(heading, groups):
                for group in groups:
                    yield f"{group.name}.png", encode(draw_group(group, heading), "png")
            case Folded() | Banner() | OnPage():
                yield from pictures_of(block.blocks)
