"""Writes the FMU of a deck."""

import hashlib
import io
import json
import re
import zipfile
from collections.abc import Callable
from importlib.resources import files
from pathlib import PurePosixPath
from typing import Any

from msahl.api.model import Model
from msahl.api.options import RunOptions
from msahl.fmu.description import Description, description_2, description_3, is_known
from msahl.fmu.slave import DECK, RUN
from msahl.records import record
from msahl.run.options import OptionError
from msahl.version import VERSION

ENDINGS = (".so", ".dll", ".dylib")
EPOCH = (1980, 1, 1, 0, 0, 0)
"""Time of the files in an FMU: the same deck gives the same bytes."""
MODULE = '''\
"""The instance of an FMU of msahl {version}: needs that in the Python that runs it."""

import sys

try:
    from msahl.fmu.slave import {base}, keep
except ImportError as error:
    raise ImportError(
        "this FMU needs msahl {version}, which cannot be imported by the Python in "
        f"{{sys.prefix}} ({{sys.version.split()[0]}}): {{error}}; install it there: "
        "pip install msahl=={version}"
    ) from error


keep(globals())


class {name}({base}):
    pass
'''


@record
class Kind:
    """A version of FMI: the package that has its binaries, their base class, and the writer of
    descriptions.
    """

    package: str
    base: str
    describe: Callable[[Description], bytes]


KINDS = {
    "2": Kind("pythonfmu", "Fmi2Slave", description_2),
    "3": Kind("pythonfmu3", "Fmi3Slave", description_3),
}
"""By the number of the version."""


def fmu(model: Model, options: RunOptions, name: str, version: str) -> bytes:
    """Return the FMU called ``name`` of a ``model`` that runs with these ``options``, for a
    ``version`` of FMI. Raises ``OptionError`` if the binaries are not installed, and what the start
    of a run raises.
    """
    kind, identifier = KINDS[version], identifier_of(name)
    binaries = _binaries(kind)
    run = model.co_simulation(**options)
    _ = run.values  # the model must start
    files_of_run = _files(model, options)
    digest = hashlib.sha256(f"{VERSION} {identifier} {version} {files_of_run}".encode()).hexdigest()
    given = Description(
        identifier=identifier,
        title=run.title,
        token=f"{digest[:8]}-{digest[8:12]}-{digest[12:16]}-{digest[16:20]}-{digest[20:32]}",
        t_final=run.t_final,
        interval=run.interval,
        variables=[one for one in run.variables.values() if is_known(one)],
    )
    # A process may hold several FMUs, whose modules must differ by their names.
    module = f"{identifier}_{digest[:16]}"
    text = MODULE.format(version=VERSION, base=kind.base, name=identifier)
    contents = {
        "modelDescription.xml": kind.describe(given),
        **{f"resources/{path}": data for path, data in files_of_run.items()},
        f"resources/{module}.py": text.encode(),
        "resources/slavemodule.txt": module.encode(),
    }
    for path, data in binaries.items():
        contents[f"binaries/{path.parent}/{identifier}{path.suffix}"] = data
    return _packed(contents)


def _files(model: Model, options: RunOptions) -> dict[str, bytes]:
    """Return the files of the deck with its parts, and what an instance runs of them."""
    source = model.source
    files_of_deck = {source.path: source.data, **source.parts}
    folder = source.path.parent
    found = {
        f"{DECK}/{path.relative_to(folder).as_posix()}": data
        for path, data in files_of_deck.items()
    }
    given = {name: value for name, value in options.items() if value is not None}
    run = {"deck": source.path.name, "changes": model.changes, "options": given}
    return {**found, RUN: json.dumps(run).encode()}


def identifier_of(name: str) -> str:
    """Return a ``name`` as an identifier of C that is no module of Python's own."""
    return f"fmu_{re.sub('[^0-9A-Za-z]+', '_', name).strip('_') or 'deck'}"


def _binaries(kind: Kind) -> dict[PurePosixPath, bytes]:
    """Return the binaries of a package by platform and name."""
    try:
        folder = files(kind.package) / "resources" / "binaries"
    except ImportError:
        raise OptionError(
            [f"the binaries of the FMU come with {kind.package}: pip install 'msahl[fmu]'"]
        ) from None
    found: dict[PurePosixPath, bytes] = {}
    for platform in folder.iterdir():
        for file in platform.iterdir():
            if file.name.endswith(ENDINGS):
                found[PurePosixPath(platform.name, file.name)] = file.read_bytes()
    return found


def _packed(contents: dict[str, bytes]) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for name, data in contents.items():
            info: Any = zipfile.ZipInfo(name, EPOCH)
            archive.writestr(info, data, zipfile.ZIP_DEFLATED)
    return stream.getvalue()
