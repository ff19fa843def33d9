"""Save small pictures and set their axes."""

from io import BytesIO
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

DPI = 90


def save_small(figure: Figure, path: Path, colours: int = 48) -> Path:
    """Write a PNG with few ``colours`` and without a date; return its path."""
    from PIL import Image

    path.parent.mkdir(parents=True, exist_ok=True)
    stream = BytesIO()
    figure.savefig(stream, format="png", dpi=DPI, metadata={"Software": None})
    stream.seek(0)
    picture = Image.open(stream).convert("RGB").quantize(colours, dither=Image.Dither.NONE)
    picture.save(path, optimize=True)
    return path


def bounded(axes: Axes, values: np.ndarray, floor: float) -> None:
    """Set a logarithmic axis that shows at least three decades and at most eight."""
    top = max(float(np.max(values, initial=0.0)), 10.0 * floor)
    known = values[values > 0.0]
    low = max(float(known.min()) if known.size else floor, top * 1e-8)
    axes.set_ylim(min(low, top * 1e-3), 3.0 * top)
