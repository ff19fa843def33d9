"""``msahl.import_file``: a model and what is not carried over."""

import pytest

import msahl
from tests.importers.test_urdf import tetrahedron
from tests.support.models import ROOT

ARM = ROOT / "examples" / "arm.urdf"


def test_a_file_becomes_a_model_and_notes():
    model, notes = msahl.import_file(ARM, pose={"elbow": 0.5})
    assert model.title == "Arm with gripper"
    assert {note.where for note in notes} > {"joint 'elbow', limit"}
    assert model.with_(**{"elbow.angle": 0.7}).records != model.records


def test_packages_are_one_folder_or_several(tmp_path):
    robot = tmp_path / "here" / "arm.urdf"
    robot.parent.mkdir()
    mesh = '<mesh filename="package://arm/part.stl"/>'
    text = ARM.read_text().replace('<box size="0.05 0.12 0.04"/>', mesh)
    assert mesh in text
    robot.write_text(text)
    (tmp_path / "arm").mkdir()
    tetrahedron(tmp_path / "arm" / "part.stl")
    for packages in (str(tmp_path), tmp_path, [tmp_path]):
        _, notes = msahl.import_file(robot, packages=packages)
        (message,) = [note.message for note in notes if "part.stl" in note.message]
        assert "is not below the folder of the deck" in message  # it was found


def test_wrong_arguments_and_files_are_named():
    with pytest.raises(msahl.OptionError, match="base"):
        msahl.import_file(ARM, base="loose")
    with pytest.raises(msahl.OptionError, match="finite numbers by name"):
        msahl.import_file(ARM, pose={"elbow": "x"})
    with pytest.raises(msahl.DeckError, match="knee"):
        msahl.import_file(ARM, pose={"knee": 1.0})
