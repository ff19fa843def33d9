"""The error of a run by the mesh of its beams: estimated against a fine mesh, judged, and told."""

import numpy as np
import pytest

from msahl.api.running import finer_mesh, run_job
from msahl.deck.source import Source
from msahl.model import Options
from msahl.model.settings import OFF
from msahl.results.job import make_job
from msahl.run import loop, mesh_error
from msahl.run.tables import ERROR, STATES, MemorySink
from msahl.run.verdict import DONE, PASS, WARN
from msahl.study.more_elements import by_name


def strip(elements, degree, spin=0.0, load=1.0, more="", simulation=""):
    """A cantilever of 1 m, or a blade at a ``spin`` [rad/s], with a force at its tip from t = 0."""
    joint, axis = ("revolute", "<axis><z>1</z></axis>") if spin else ("rigid", "")
    return f"""<data><system><bodies><ground><name>G</name></ground>
<beam><name>S</name><elements>{elements}</elements><degree>{degree}</degree>
<centreLine><straight><end><x>1</x></end></straight></centreLine>
<section><rectangle><width units="mm">30</width><height units="mm">10</height></rectangle></section>
<material><youngsModulus units="GPa">2.1</youngsModulus><poissonsRatio>0.3</poissonsRatio>
<density units="kg/m^3">1000</density></material>
<initialConditions><angularVelocity><omega3>{spin}</omega3></angularVelocity></initialConditions>
{more}</beam></bodies>
<joints><{joint}><name>Clamp</name><parent><name>G</name>{axis}</parent>
<child><name node="first">S</name></child></{joint}></joints>
<loads><concentrated><name>F</name><body node="last">S</body>
<force basis="G"><zForce>{load}</zForce></force></concentrated></loads></system>
<simulation {simulation}><deltaT>0.005</deltaT><tFinal>0.15</tFinal></simulation></data>"""


def job_of(text, **given):
    source = Source.of(text)
    return make_job(source, source.model(()), given)


def estimated(text, **given):
    """Report and tables of a run with the estimate of the error by its mesh, and its model."""
    job, sink = job_of(text, **given), MemorySink()
    report = loop.run(job.model, job.options, sink, checked=True, finer=finer_mesh(job))
    return report, sink, job.model


def positions(text):
    """Positions where a fine mesh has nodes as well."""
    model, sink = job_of(text).model, MemorySink(only=(STATES,))
    loop.run(model, Options(error=OFF), sink, checked=True)
    return by_name(model, sink.table(STATES)[:, 1:])


@pytest.mark.parametrize("scene", [{}, {"spin": 20.0, "load": 5.0}], ids=["pluck", "blade"])
def test_the_estimate_is_near_the_error_against_a_fine_mesh(scene):
    truth = positions(strip(4, 4, **scene))
    for elements, degree in ((1, 1), (2, 1), (1, 2), (2, 2)):
        report, sink, model = estimated(strip(elements, degree, **scene))
        own = by_name(model, sink.table(STATES)[:, 1:])
        true = max(np.abs(own[place] - truth[place]).max() for place in own)
        assert 0.3 < report.error["mesh"]["error"] / true < 10.0
        # The table has the errors of steps and mesh together.
        assert sink.table(ERROR)[:, 1].max() >= report.error["mesh"]["error"]
        assert report.error["position"] >= report.error["mesh"]["error"]


def test_one_element_of_degree_one_does_not_pass():
    """The tip bends hardly at all: nearly all of its motion is wrong."""
    report, _, _ = estimated(strip(1, 1, load=0.5))
    text = report.verdict["checks"]["accuracy"]["text"]
    assert report.verdict["word"] == WARN
    assert "of it by the mesh of the beams; the mesh is too coarse: try" in text
    assert "--dt" not in text
    report, _, _ = estimated(strip(3, 3, load=0.5))
    # The steps do not resolve axial vibrations, of which the clamp's force consists.
    assert report.verdict["checks"]["accuracy"]["word"] == PASS, report.verdict["reasons"]


@pytest.mark.slow  # kernels of its own: a minute and a half to compile
def test_a_tolerance_means_steps_and_mesh():
    auto = 'scheme="auto"'
    report, _, _ = estimated(strip(2, 2, simulation=auto), tolerance=1e-4)
    assert report.verdict["word"] == WARN
    assert len(report.step_control["runs"]) == 1  # smaller steps would not help
    assert "try" in report.verdict["checks"]["accuracy"]["text"]


def test_what_has_no_finer_mesh_is_done_at_best():
    """Twelve numbers say where each node begins, which a finer mesh has not."""
    nodes = " ".join(f"{x} 0 0 0 0 0 0 0 0 0 0 0" for x in (0, 1))
    report, _, _ = estimated(strip(1, 1, load=0.0, more=f"<nodes>{nodes}</nodes>"))
    assert report.verdict["word"] == DONE
    assert "beam 'S' begins where <nodes> says" in report.verdict["checks"]["accuracy"]["text"]
    records = Source.of_model(job_of(strip(1, 1)).model)
    assert finer_mesh(job_of(records.data.decode())).none.startswith("beam 'S' is given by its")


def test_a_finer_mesh_that_leaves_the_run_says_nothing(monkeypatch):
    monkeypatch.setattr(mesh_error, "SAFETY", 1e9)  # as if the runs were far from each other
    report, sink, _ = estimated(strip(1, 2))
    assert "did not follow it" in report.error["mesh"]["unknown"]
    assert report.verdict["word"] != PASS
    assert sink.table(ERROR)[:, 1].max() < 1.0


def test_results_in_memory_have_it_and_runs_without_estimate_do_not():
    assert run_job(job_of(strip(1, 2))).report["error"]["mesh"]["degree"] == 2
    assert finer_mesh(job_of(strip(1, 2), error="off")) is None
