"""Files of meshes: where they are, and what decks can show of them.

A mesh is looked for in the folder of the file that names it, and in the folders that the user
gives. ``package://NAME/arm.stl`` is ``arm.stl`` in a folder NAME below one of these, or in one of
these that is called NAME. A deck names meshes from its own folder, so those elsewhere are copied,
if that is wanted.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath

from msahl.check.shapes import FILES
from msahl.deck.faults import DeckError, Element
from msahl.importers.reading import Log, numbers
from msahl.importers.robot import Look, Pose
from msahl.post.scene.meshes import Mesh, read_mesh

SCHEMES = ("package://", "model://", "file://")
MOST_MESHES = 2000
"""Files of meshes that are read."""


@dataclass
class MeshFiles:
    """Meshes below ``folders``, for a deck in the folder ``target``; those outside it are copied
    into its folder ``copied``, by ``copies``, if this has a name."""

    folders: Sequence[Path]
    target: Path
    copied: str = ""
    copies: dict[str, Path] = field(default_factory=dict)
    _read: dict[Path, Mesh | str] = field(default_factory=dict)

    def look(self, element: Element, file: str, pose: Pose, colour: str, log: Log) -> list[Look]:
        """Return the shape of an element that names the ``file`` of a mesh; none, with a note, if
        a deck cannot show it."""
        scale = numbers(element, "scale", log, (1.0, 1.0, 1.0))
        path = self.find(file)
        reason = ""
        if path is None:
            reason = f"mesh '{file}' is not below the folder of this file; {_remedy(file)}"
        elif path.suffix.lower() not in FILES:
            reason = f"mesh '{file}' is no STL or OBJ file; convert it"
        elif not (scale[0] > 0.0 and all(math.isclose(scale[0], one) for one in scale[1:])):
            reason = f"mesh '{file}' is scaled unevenly or mirrored; change the mesh instead"
        name = "" if path is None or reason else self._from_target(path)
        if not reason and not name:
            reason = f"mesh '{file}' is not below the folder of the deck; --copy-meshes copies it"
        if not reason and path is not None and isinstance(self._mesh(path), str):
            reason = str(self._mesh(path))
        if reason:
            log.lost(element, reason)
            return []
        return [Look("mesh", (scale[0],), pose, colour, name)]

    def find(self, file: str) -> Path | None:
        """Return the file that a reference means; None if there is none below the folders."""
        scheme = next((s for s in SCHEMES if file.startswith(s)), "")
        parts = PurePosixPath(file.removeprefix(scheme)).parts
        if not parts or ".." in parts[:1] or not file.isprintable():
            return None
        for folder in self.folders:
            places = [folder.joinpath(*parts)]
            if scheme in SCHEMES[:2] and folder.name == parts[0]:
                places.append(folder.joinpath(*parts[1:]))
            for place in places:
                found = below(place, folder)
                if found is not None:
                    return found
        return None

    def _from_target(self, path: Path) -> str:
        """Return the path of a mesh from the folder of the deck; "" if it is elsewhere and not to
        be copied."""
        target = self.target.resolve()
        if path.is_relative_to(target):
            return path.relative_to(target).as_posix()
        if not self.copied:
            return ""
        name = f"{self.copied}/{path.name}"
        for number in range(2, MOST_MESHES):
            if self.copies.setdefault(name, path) == path:
                break
            name = f"{self.copied}/{path.stem}_{number}{path.suffix}"
        return name

    def mesh(self, look: Look) -> Mesh | None:
        """Return the triangles of a shape in metres; None if it is no mesh."""
        if look.kind != "mesh":
            return None
        path = self.copies.get(look.file, self.target.resolve() / look.file)
        mesh = self._mesh(path)
        return (
            None if isinstance(mesh, str) else mesh._replace(vertices=mesh.vertices * look.size[0])
        )

    def _mesh(self, path: Path) -> Mesh | str:
        """Return the triangles of a file, or why they cannot be read."""
        if path not in self._read:
            if len(self._read) >= MOST_MESHES:
                return f"more than {MOST_MESHES} files of meshes"
            try:
                self._read[path] = read_mesh(path)
            except DeckError as error:
                self._read[path] = str(error)
        return self._read[path]


def below(place: Path, folder: Path) -> Path | None:
    """Return the file at ``place``, resolved, if there is one and it lies below ``folder``."""
    try:
        real = place.resolve(strict=True)
        good = real.is_file() and real.is_relative_to(folder.resolve())
    except (OSError, RuntimeError, ValueError):
        return None
    return real if good else None


def _remedy(file: str) -> str:
    """Return what to do about a mesh that is not found."""
    parts = PurePosixPath(file.removeprefix("package://").removeprefix("model://")).parts
    if file.startswith(SCHEMES[:2]) and parts:
        return f"give the folder that has '{parts[0]}' by --packages"
    return "give its folder by --packages"
