"""Import of machines from other programs' files: URDF, SDF and MJCF become decks.

file -> robot (links, joints; one reader for each format) -> bodies -> records -> text of a deck
"""

from msahl.importers.options import BASES, ImportOptions
from msahl.importers.read import Imported, import_file
from msahl.importers.reading import Note

__all__ = ["BASES", "ImportOptions", "Imported", "Note", "import_file"]
