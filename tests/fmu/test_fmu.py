"""FMUs in a master (fmpy): validity, the numbers of a run, states, faults, controllers."""

import gc
import math
import subprocess
import sys
import zipfile

import numpy as np
import pytest
from fmpy import extract, read_model_description, simulate_fmu
from fmpy.fmi2 import (
    FMU2Slave,
    calloc,
    fmi2CallbackAllocateMemoryTYPE,
    fmi2CallbackFreeMemoryTYPE,
    fmi2CallbackFunctions,
    fmi2CallbackLoggerTYPE,
    free,
)
from fmpy.fmi3 import FMU3Slave, fmi3LogMessageCallback
from fmpy.validation import validate_fmu

import msahl
from msahl.fmu.export import fmu, identifier_of
from tests.support.models import ROOT

FORCES = ROOT / "decks" / "forces"
CART = FORCES / "actuator_input.xml"
VERSIONS = pytest.mark.parametrize("version", ["2", "3"])
BOTH = ("2", "3")


@pytest.fixture(scope="module")
def carts(tmp_path_factory):
    """The FMUs of the cart, by version of FMI."""
    folder, model = tmp_path_factory.mktemp("fmus"), msahl.load(CART)
    paths = {version: folder / f"cart{version}.fmu" for version in BOTH}
    for version, path in paths.items():
        path.write_bytes(fmu(model, {}, "cart", version))
    return paths


class Instance:
    """An instance of an FMU, with the messages that it gave."""

    def __init__(self, path, folder, version):
        given = read_model_description(str(path))
        self.version, self.messages = version, []
        self.reference = {one.name: one.valueReference for one in given.modelVariables}
        unzipped = extract(str(path), str(folder))
        name = given.coSimulation.modelIdentifier
        kind, token = (
            (FMU2Slave, given.guid) if version == "2" else (FMU3Slave, given.instantiationToken)
        )
        self.slave = kind(
            guid=token, unzipDirectory=unzipped, modelIdentifier=name, instanceName="one"
        )
        if version == "2":
            self.kept = fmi2CallbackFunctions(
                logger=fmi2CallbackLoggerTYPE(lambda *given: self.note(given[2], given[4])),
                allocateMemory=fmi2CallbackAllocateMemoryTYPE(calloc),
                freeMemory=fmi2CallbackFreeMemoryTYPE(free),
            )
            self.slave.instantiate(callbacks=self.kept, loggingOn=True)
        else:
            self.kept = fmi3LogMessageCallback(lambda *given: self.note(given[1], given[3]))
            self.slave.instantiate(loggingOn=True, logMessage=self.kept)

    def note(self, status, text):
        self.messages.append((status, text.decode()))

    def initialize(self, **times):
        if self.version == "2":
            self.slave.setupExperiment(startTime=0.0, **times)
            self.slave.enterInitializationMode()
        else:
            self.slave.enterInitializationMode(startTime=0.0, **times)

    def start(self):
        self.initialize()
        self.slave.exitInitializationMode()

    def set(self, **values):
        call = self.slave.setReal if self.version == "2" else self.slave.setFloat64
        call([self.reference[name] for name in values], [*values.values()])

    def get(self, name):
        call = self.slave.getReal if self.version == "2" else self.slave.getFloat64
        return call([self.reference[name]])[0]

    def step(self, begin, size):
        """Take a step; return the words of the exception if it fails."""
        try:
            self.slave.doStep(begin, size)
        except Exception as error:
            return str(error)
        return ""

    def bytes_of_state(self):
        if self.version == "2":
            return self.slave.serializeFMUstate(self.slave.getFMUstate())
        return self.slave.serializeFMUState(self.slave.getFMUState())

    def restore(self, state):
        if self.version == "2":
            self.slave.setFMUstate(self.slave.deSerializeFMUstate(state))
        else:
            self.slave.setFMUState(self.slave.deserializeFMUState(state))


@pytest.fixture
def instance(carts, tmp_path):
    """Make instances of the cart by the version of FMI."""
    made = []

    def make(version):
        made.append(Instance(carts[version], tmp_path / str(len(made)), version))
        return made[-1]

    yield make
    for one in made:
        one.slave.freeInstance()


@VERSIONS
def test_the_cart_is_valid(carts, version):
    assert validate_fmu(str(carts[version])) == []
    given = read_model_description(str(carts[version]))
    found = {one.name: one for one in given.modelVariables}
    assert given.coSimulation.canHandleVariableCommunicationStepSize
    assert (found["force"].causality, found["force"].start, found["force"].unit) == (
        "input",
        "4.0",
        "N",
    )
    assert (found["m"].causality, found["m"].variability) == ("parameter", "fixed")
    assert found["Spring.stiffness"].variability == "tunable"
    assert found["Cart.vx"].causality == "output"
    assert given.defaultExperiment.stopTime == "2.0"


@VERSIONS
@pytest.mark.parametrize(
    ("deck", "options"),
    [
        ("forces/actuator_input", {"t_final": 0.2}),
        ("mechanisms/suspension", {"t_final": 0.2}),  # a deck with parts
        ("forces/actuator_pid", {"scheme": "auto", "local_tolerance": 1e-8}),
    ],
)
def test_a_master_gets_the_numbers_of_a_run_to_the_bit(version, deck, options, tmp_path):
    path = ROOT / "decks" / f"{deck}.xml"
    model, file = msahl.load(path), tmp_path / "deck.fmu"
    file.write_bytes(fmu(model, options, path.stem, version))
    assert validate_fmu(str(file)) == []
    result = model.run(error="off", **options)
    names = [one.name for one in model.co_simulation(**options).variables.values()]
    names = [name for name in names if name in result.columns("states")]
    times = {"stop_time": float(result.time[-1]), "output_interval": float(result.time[1])}
    found = simulate_fmu(str(file), output=names, **times)
    assert len(found) == len(result.time)
    for name in names:
        assert np.array_equal(found[name], result[name])


@VERSIONS
def test_start_values_and_signals_of_a_master(carts, version):
    """Another mass, and a force that a signal gives at the communication points."""
    signals = np.array([(0.0, 2.0), (0.5, 2.0), (0.5, -1.0), (1.0, -1.0)])
    table = np.rec.fromrecords(signals, names=["time", "force"])
    found = simulate_fmu(
        str(carts[version]),
        stop_time=1.0,
        output_interval=0.01,
        start_values={"m": 4.0, "Spring.stiffness": 16.0},
        input=table,
        output=["Rail.slide", "Drive.load"],
    )
    run = msahl.load(CART).co_simulation()
    run.set({"m": 4.0, "Spring.stiffness": 16.0, "force": 2.0})
    for t in found["time"][1:]:
        before = run.time
        run.set({"force": 2.0 if before < 0.5 - 1e-9 else -1.0})
        run.advance(t)
    assert run["Rail.slide"] == found["Rail.slide"][-1]
    assert found["Drive.load"][-1] == -1.0


@VERSIONS
def test_a_state_is_saved_and_restored(instance, version):
    """To the bit, in the same instance and as bytes in another one."""
    one = instance(version)
    one.start()
    assert not one.step(0.0, 0.1)
    one.set(force=-3.0)
    state = one.bytes_of_state()
    assert not one.step(0.1, 0.25)
    after = one.get("Rail.slide")
    another = instance(version)
    another.start()
    for again in (one, another):
        again.restore(state)
        assert again.get("force") == -3.0
        assert not again.step(0.1, 0.25)
        assert again.get("Rail.slide") == after


@VERSIONS
@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"force": math.nan}, "force: it is nan; give a finite number"),
        ({"m": -1.0}, "body 'Cart', mass: the mass is -1 kg; it must be greater than zero"),
        ({"Cart.x": 1.0}, "Cart.x is a result of the run"),
    ],
)
def test_faults_of_values_are_messages(instance, version, values, words):
    """The process of the master goes on; a step fails, until a good state is restored."""
    good = instance(version)
    good.start()
    state = good.bytes_of_state()
    one = instance(version)
    one.initialize()
    one.set(**values)
    one.slave.exitInitializationMode()
    failed = one.step(0.0, 0.1)
    assert ("discard" if version == "2" else "error") in failed
    assert all(words in text and status == 3 for status, text in one.messages)
    one.restore(state)
    assert not one.step(0.0, 0.1)
    gc.collect()


@VERSIONS
def test_faults_of_steps_are_messages(instance, version):
    one = instance(version)
    one.start()
    one.set(m=3.0)
    assert not one.step(0.0, 0.5)
    assert one.step(0.5, 2.0)
    assert "the run ends at t = 2 s, before t = 2.5 s" in one.messages[-1][1]
    assert one.step(0.7, 0.1)
    assert "the run stands at t = 0.5 s" in one.messages[-1][1]
    assert not one.step(0.5, 0.5)
    one.restore(b"rubbish")
    assert "it is not the saved state of a run" in one.messages[-1][1]
    assert one.step(1.0, 0.1)


def test_a_stop_time_after_the_end_of_the_deck(instance):
    one = instance("2")
    one.initialize(stopTime=7.0)
    one.slave.exitInitializationMode()
    assert one.step(0.0, 0.1)
    assert "the stop time is 7 s, and the deck's run ends at 2 s" in one.messages[0][1]


@VERSIONS
def test_many_instances(carts, tmp_path, version):
    """The binaries of pythonfmu 0.7 give back what they borrow; nothing is freed in use."""
    for k in range(6):
        one = Instance(carts[version], tmp_path / str(k), version)
        one.start()
        assert not one.step(0.0, 0.1)
        one.slave.freeInstance()
        gc.collect()
    with zipfile.ZipFile(carts[version]) as archive:
        module = archive.read("resources/slavemodule.txt").decode()
    assert 1 < sys.getrefcount(vars(sys.modules[module])) < 10


def test_the_same_deck_gives_the_same_bytes():
    model = msahl.load(CART)
    assert fmu(model, {}, "cart", "2") == fmu(model, {}, "cart", "2")


@pytest.mark.parametrize(
    ("name", "identifier"),
    [("cart", "fmu_cart"), ("4 bars-é", "fmu_4_bars"), ("...", "fmu_deck")],
)
def test_identifiers(name, identifier):
    assert identifier_of(name) == identifier


def test_without_msahl_the_module_says_what_to_do(carts, tmp_path):
    """Python without its packages stands for one in which msahl is not installed."""
    with zipfile.ZipFile(carts["2"]) as archive:
        (name,) = (n for n in archive.namelist() if n.endswith(".py"))
        (tmp_path / "module.py").write_bytes(archive.read(name))
    command = [sys.executable, "-I", "-S", str(tmp_path / "module.py")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert f"this FMU needs msahl {msahl.__version__}, which cannot be imported" in done.stderr
    assert "pip install msahl" in done.stderr


def test_without_binaries_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "pythonfmu", None)
    with pytest.raises(msahl.OptionError, match=r"pip install 'msahl\[fmu\]'"):
        fmu(msahl.load(CART), {}, "cart", "2")
