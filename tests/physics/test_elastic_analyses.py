"""Elastic bodies in what the program does with models: gradients, batches, resumed runs, sweeps,
inverse dynamics, modes about equilibria."""

import csv
import re
import shlex
import shutil

import numpy as np
import pytest
from click.testing import CliRunner

import msahl
from msahl.cli.main import main
from tests.run.test_resume import call, interrupted, tables
from tests.support.models import ROOT

BLADE = ROOT / "decks" / "elastic" / "reduced_blade.xml"
SHORT = {"dt": 0.01, "t_final": 0.1, "error": "off"}


def energy(g):
    """Elastic energy of the blade at the end of a short run [J]."""
    result = msahl.load(BLADE, g=g).run(**SHORT)
    return float(result["Blade.energy"][-1])


@pytest.mark.slow
def test_gradients_are_those_of_complete_runs():
    found = msahl.load(BLADE).gradient("Blade.energy final", wrt=["g"], **SHORT)
    d = 1e-3  # m/s^2, of 0.2: the energy is nearly quadratic in g, so differences are exact
    wanted = (energy(0.2 + d) - energy(0.2 - d)) / (2.0 * d)
    assert np.ravel(found.jacobian) == pytest.approx([wanted], rel=1e-6)


def test_batches_are_single_runs():
    runs = msahl.batch(msahl.load(BLADE), [{"g": 0.1}, {"g": 0.2}], tables=["work"], **SHORT)
    for g, one in zip((0.1, 0.2), runs, strict=True):
        assert float(one["Blade.energy"][-1]) == energy(g)


@pytest.mark.slow
def test_a_run_is_resumed_to_the_byte(tmp_path, monkeypatch):
    words = (BLADE, "--dt", 0.01, "--t-final", 0.1)
    result = interrupted(monkeypatch, tmp_path / "out", *words)
    again = result.stderr.split("resume it with: ")[1].splitlines()[0]
    assert call(*shlex.split(again)[2:]).exit_code == 0
    assert call(*words, "-o", tmp_path / "complete").exit_code == 0
    assert tables(tmp_path / "out") == tables(tmp_path / "complete")


@pytest.mark.slow
def test_a_sweep_over_the_damping_of_a_mode(tmp_path):
    """Mode 1 is released at rest: after 20 ms it has the amplitude of its own oscillator with the
    damping of each point. Its decrement by period is 2 pi zeta/(1 - zeta^2)^(1/2)."""
    text = (BLADE.parent / "reduced_rod.xml").read_text()
    text = text.replace("<dampingRatio>0.02<", "<dampingRatio>{zeta}<")
    given = '<parameters><parameter name="zeta">0.02</parameter></parameters><system>'
    (tmp_path / "parts").mkdir()
    shutil.copy(BLADE.parent / "parts" / "rod.npz", tmp_path / "parts")
    (tmp_path / "rod.xml").write_text(text.replace("<system>", given))
    words = [
        "sweep",
        str(tmp_path / "rod.xml"),
        "--set",
        "zeta=0.01,0.05",
        "--jobs",
        "1",
        "--error",
        "off",
    ]
    words += ["--measure", "Rod.1.amplitude final", "-o", str(tmp_path / "sweep")]
    done = CliRunner().invoke(main, words)
    assert done.exit_code == 0, done.output
    rows = list(csv.DictReader((tmp_path / "sweep" / "runs.csv").read_text().splitlines()))
    assert [float(row["zeta"]) for row in rows] == [0.01, 0.05]
    omega, t = 2.0 * np.pi * 288.17759032, 0.02  # of the file, to 1e-10
    for zeta, row in zip((0.01, 0.05), rows, strict=True):
        [found] = [float(value) for name, value in row.items() if name.startswith("Rod.1.ampl")]
        w = omega * np.sqrt(1.0 - zeta**2)
        decay = np.exp(-(w * t / (2.0 * np.pi)) * 2.0 * np.pi * zeta / np.sqrt(1.0 - zeta**2))
        wanted = 1e-3 * decay * (np.cos(w * t) + zeta * omega / w * np.sin(w * t))
        # 36 rad of a frequency to 1e-10; gauss3 with 35 steps a period has 2e-11 m.
        assert found == pytest.approx(wanted, abs=1e-10)


@pytest.mark.slow
def test_the_motor_of_a_mechanism_by_inverse_dynamics():
    """States and accelerations of the bodies that tables show determine the motion, amplitudes
    too; without them the message names the body, not what carries its mass."""
    model = msahl.load(BLADE.parent / "reduced_slider_crank.xml")
    run = model.run(t_final=0.004, error="off", accelerations="yes")
    found = model.inverse(run, loads=["Motor"])
    assert found.verdict == "PASS"
    assert np.abs(run["Motor.load"]).max() > 1.0
    # Errors of the steps of the run are not in the balance at its output times.
    assert found["Motor.load"] == pytest.approx(run["Motor.load"], abs=1e-8)
    with pytest.raises(msahl.InverseError, match="in the motion of Rod; give more coordinates"):
        model.inverse(run.frame("markers"), loads=["Motor"])


@pytest.fixture(scope="module")
def blades(tmp_path_factory):
    """A function that returns a blade with gravity: of beams, or reduced with stiffening or not;
    with a hub that a motor holds, or a free one."""
    folder = tmp_path_factory.mktemp("blades")
    (folder / "parts").mkdir()
    shutil.copy(BLADE.parent / "parts" / "blade.npz", folder / "parts")
    reduced, beams = BLADE.read_text(), (BLADE.parent / "blade.xml").read_text()
    beams = beams.replace("<system>", "<system><gravity><g3>{-g}</g3></gravity>")
    beams = beams.replace("</parameters>", '<parameter name="g">0</parameter></parameters>')
    texts = {"beams": beams, "stiffened": reduced}
    texts["linear"] = reduced.replace(' stiffening="true"', "")

    def blade(kind, g, speed=0.0):
        text = texts[kind]
        if speed:
            text = re.sub("<motions>.*</motions>", "", text, flags=re.S)
        path = folder / f"{kind}{bool(speed)}.xml"
        path.write_text(text)
        return msahl.load(path, g=g, speed=speed)

    return blade


def frequencies(rest):
    found = 2.0 * np.pi * rest.model.modes().frequency
    return found[found > 1e-3]  # a free hub rotates at zero frequency


@pytest.mark.slow
def test_modes_about_a_sagging_equilibrium(blades):
    """A cantilever that sags by a share s of its length: the first frequency differs from that of
    beams by 1.3 s^2, as displacements of third order are omitted."""
    errors = []
    for g in (0.1, 0.2):
        exact, found, linear = (
            frequencies(blades(kind, g).equilibrium())[0]
            for kind in ("beams", "stiffened", "linear")
        )
        sag = g / 8.0  # m g L^4/(8 E I)
        errors.append(found / exact - 1.0)
        assert abs(errors[-1]) < 1.5 * sag**2
        assert abs(linear / exact - 1.0) > 1.4 * abs(errors[-1])
    # The rotary inertia of 1e-6 of both blades is that of the mesh to 1e-6 of the frequency.
    assert errors[1] / errors[0] == pytest.approx(4.0, abs=0.3)


@pytest.mark.slow
def test_modes_about_a_rotating_equilibrium(blades):
    """At 5 rad/s the blade is stretched, and gravity bends it by 0.7 % of its length: frequencies
    of flapping and lagging are those of beams."""
    exact, found, linear = (
        frequencies(blades(kind, 0.2, 5.0).equilibrium(rotation=(0.0, 0.0, 5.0)))
        for kind in ("beams", "stiffened", "linear")
    )
    # Omitted modes and the third order of the sag: some 1e-4.
    assert found[:3] == pytest.approx(exact[:3], rel=3e-4)
    assert linear[0] < 0.95 * exact[0]


@pytest.mark.slow
def test_the_hub_carries_the_weight_of_a_sagging_blade(blades):
    """Its moment is m g times the mean x, which is less as the blade sags by an eighth of its
    length: by 0.61 % with large displacements."""
    found = {}
    for kind in ("beams", "stiffened", "linear"):
        rest = blades(kind, 1.0).equilibrium()
        found[kind] = abs(rest["Hub.My"])
    assert found["beams"] < 0.995 * 0.5
    # The next order in the sag, which is of second order in 0.61 %, and six modes.
    assert found["stiffened"] == pytest.approx(found["beams"], rel=3e-4)
    assert found["linear"] > 1.001 * found["beams"]  # a straight line in the frame
