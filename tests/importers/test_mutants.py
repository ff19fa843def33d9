"""Whatever the file: a deck that can be read or faults with file and line, and never a traceback.

``MSAHL_FUZZ_SECONDS`` draws new mutants for so long; otherwise they are the same every time.
"""

import os
import time

import pytest

from msahl.deck import DeckError
from msahl.importers import ImportOptions, import_file
from tests.importers import forces, loops
from tests.importers.mutants import mutant
from tests.importers.oracle import FILES
from tests.support.models import ROOT

SECONDS = float(os.environ.get("MSAHL_FUZZ_SECONDS", "0"))
NUMBER = 60
FILES_AND_SDF = [*FILES, ROOT / "examples" / "four_bar.sdf", loops.FILE]
SOURCES = {file.name: file.read_bytes() for file in FILES_AND_SDF}
SOURCES |= {
    f"{name}.xml": forces.MODELS[name].encode()
    for name in ("actuators at ball joints", "fixed tendons", "damping ratios", "replicates")
}


def outcome(path):
    """How the import of a file ends; its messages name the file."""
    options = ImportOptions(repair=path.stat().st_size % 2 == 0)
    try:
        found = import_file(path, options)
    except DeckError as error:
        faults = error.faults
    else:
        assert found.source.model().bodies
        assert all(note.message and note.line >= 0 for note in found.notes)
        return "deck"
    assert faults
    assert all(str(fault).startswith(str(path)) and fault.message for fault in faults)
    return "faults"


@pytest.mark.slow
@pytest.mark.parametrize("name", list(SOURCES))
def test_mutants_become_decks_or_messages(name, tmp_path):
    data, number = SOURCES[name], 0
    first = int(time.time()) if SECONDS else 0
    end, ends = time.monotonic() + 0.3 * SECONDS / len(SOURCES), set()
    while number < NUMBER or time.monotonic() < end:
        path = tmp_path / f"mutant.{name.rpartition('.')[2]}"
        path.write_bytes(mutant(data, first + number))
        try:
            ends.add(outcome(path))
        except Exception as error:
            raise AssertionError(f"mutant {first + number}") from error
        number += 1
    assert ends == {"deck", "faults"}
