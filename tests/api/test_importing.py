"""``msahl.import_file``: a model and what is not carried over."""

import pytest

import msahl
from tests.support.models import ROOT

ARM = ROOT / "examples" / "arm.urdf"


def test_a_file_becomes_a_model_and_notes():
    model, notes = msahl.import_file(ARM, pose={"elbow": 0.5})
    assert model.title == "Arm with gripper"
    assert {note.where for note in notes} > {"joint 'elbow', limit"}
    assert model.with_(**{"elbow.angle": 0.7}).records != model.records


def test_wrong_arguments_and_files_are_named():
    with pytest.raises(msahl.OptionError, match="base"):
        msahl.import_file(ARM, base="loose")
    with pytest.raises(msahl.DeckError, match="knee"):
        msahl.import_file(ARM, pose={"knee": 1.0})
