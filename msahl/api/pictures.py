"""Pictures of a result, for notebooks and files."""

from base64 import b64encode
from collections.abc import Sequence
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

from msahl.api.arguments import require
from msahl.post.draw import encode, save, style
from msahl.post.figures import SPATIAL, figures
from msahl.post.metrics import compute_metrics
from msahl.post.run_graphs import GRAPHS
from msahl.post.run_graphs import Choice as Drawn
from msahl.results.read import Run
from msahl.run.options import Choice, path_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Pictures(dict[str, "Figure"]):
    """Figures of matplotlib by name; a notebook shows all of them."""

    def save(self, folder: str | PathLike[str], form: str = "png") -> list[Path]:
        """Write every picture to ``folder`` as "png" or "svg"; return the paths."""
        require(form=(form, Choice(("png", "svg"))))
        with style():
            return save(self.items(), (form,), path_of(folder))

    def _repr_html_(self) -> str:
        """Return the pictures for a notebook."""
        with style():
            images = [b64encode(encode(figure, "png")).decode() for figure in self.values()]
        return "".join(f'<img width="640" src="data:image/png;base64,{i}">' for i in images)


def draw(
    run: Run, kinds: Sequence[str], plane: str, bodies: tuple[str, ...], joints: tuple[str, ...]
) -> Pictures:
    """Draw a run: the ``kinds`` of pictures, or all for which it has data."""
    known = Choice((*SPATIAL, *GRAPHS))
    for kind in kinds:
        require(kind=(kind, known))
    with style():
        return Pictures(figures(run, compute_metrics(run), Drawn(plane, bodies, joints), kinds))
