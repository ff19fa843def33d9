# make run and make test need Python 3.11 or newer and GNU make, nothing else: both set up .venv.

PYTHON ?= python3
DECK ?= decks/thesis/single_pendulum_45.xml

BIN := .venv/bin
RESULTS := results
# Number of processes that run tests.
WORKERS ?= 2
# Seconds that make fuzz takes.
SECONDS ?= 300
# Tests that make coverage runs as plain Python: those that take seconds there.
COVERED ?= $(addprefix tests/,algebra check cli deck elements/test_forces.py joints post/page results start \
  $(patsubst %,api/test_%.py,models results) \
  $(patsubst %,sweep/test_%.py,axes cluster measures plan points samples shards store work) \
  $(patsubst %,post/test_%.py,commands damaged_folders document events figures metrics \
    reactions_in_joint_axes) \
  $(patsubst %,run/test_%.py,attempts options unchecked_models) \
  $(patsubst %,run/test_verdict.py::test_%,each_check_covers_its_limits the_worst_comes_first) \
  $(patsubst %,schemes/test_%.py,short_runs stepper) \
  schemes/midpoint/test_rotation_update.py::test_the_share_of_the_angle \
  $(patsubst %,study/test_%.py,closed_forms fitted_order short_studies) \
  $(patsubst %,study/test_search.py::test_%,breakpoints_of_laws a_prescribed_motion_has_breaks) \
  $(patsubst %,study/test_study.py::test_%,errors_of_a_rotated_body faults_are_reported) \
  $(patsubst %,system/test_%.py,build evaluate nonfinite))
PYTEST := $(BIN)/python -m pytest -n $(WORKERS) --dist worksteal
# The path of a deck may have spaces, at which make's functions would divide it.
SPACE := $(subst ,, )
OUT := $(RESULTS)/$(basename $(notdir $(subst $(SPACE),_,$(DECK))))

SITE := build/site

# Python keeps its compiled files, also where the environment forbids it: tests start thousands of
# processes, each of which would compile the sources again.
export PYTHONDONTWRITEBYTECODE :=

# The thesis's tables 4.2 and 4.4: angles by steps, 10 s.
SWEEP := $(RESULTS)/sweep
SWEEP_DECKS := $(foreach n,single double,$(foreach a,45 89 135,$(n)_pendulum_$(a)))
SWEEP_STEPS := 0.1,0.04,0.01,0.004,0.002
SWEEP_RUNS := $(foreach d,$(SWEEP_DECKS),$(SWEEP)/$(d)/runs.csv)
# Processes of a sweep; with one the times in the table are undisturbed.
JOBS ?= 1

.PHONY: help run test test-slow test-all test-numba kernels wheel coverage mutate fuzz lint regress regress-update sweep \
  bench thesis validation convergence stability error-table docs examples readme web clean
.DELETE_ON_ERROR:

help:
	@echo 'make run             set up .venv, run DECK ($(DECK)) and write its report'
	@echo 'make test            set up .venv, check the style and types, run all tests but the slow ones'
	@echo 'make test-slow       run the slow tests'
	@echo 'make test-all        run all tests, in one session'
	@echo 'make kernels         compile the kernels that the tests need (make test does it)'
	@echo 'make wheel           build a wheel with the machine code of all kernels, for x86-64 Linux'
	@echo 'make test-numba      run the tests of compiling with the oldest and the newest numba'
	@echo 'make lint            check the sources with ruff and mypy, and the words of all texts'
	@echo 'make coverage        measure which lines and branches the tests execute'
	@echo 'make mutate          falsify lines one by one and check that a test fails'
	@echo 'make fuzz            generate malformed decks for SECONDS ($(SECONDS)) and run them'
	@echo 'make regress         run the stored cases again and print the differences to tests/regression'
	@echo 'make regress-update  replace the results in tests/regression and print what changed'
	@echo 'make sweep           run the angles and steps of the thesis and write $(SWEEP).csv (JOBS=2: two at a time)'
	@echo 'make bench           compare speed, and time to a given error, with other programs'
	@echo 'make thesis          write docs/validation/thesis.md'
	@echo 'make validation      write all pages of docs/validation from the stored measurements'
	@echo 'make stability       run extreme models at all steps and write docs/validation/stability.md'
	@echo 'make error-table     compare error estimates with true errors and write docs/validation/error.md'
	@echo 'make convergence     repeat the experiment on the convergence errors of the thesis'
	@echo 'make docs            build the documentation site in $(SITE)'
	@echo 'make examples        run all decks for the pictures and motions of the documentation (needs Chromium)'
	@echo 'make readme          make the moving picture and the report of the README (needs Chromium)'
	@echo 'make web             build the JavaScript libraries of the pages again and compare them (needs node)'
	@echo 'make clean           remove results and build products, but keep .venv'

run: .venv/installed
	$(BIN)/msahl run "$(DECK)" -o "$(OUT)"
	@$(BIN)/msahl-post report "$(OUT)" > /dev/null
	@echo 'tables:   $(OUT)/states.csv and others beside it'
	@echo 'report:   $(OUT)/report/report.html (or report.md)'
	@echo 'pictures: $(OUT)/report/'

# The tests include those of make regress.
# Side by side, as mypy is one process, and so is the search for kernels that are missing.
test: .venv/tested
	@$(MAKE) -j2 --no-print-directory lint kernels
	@$(PYTEST) -m 'not slow'

test-slow: kernels
	@$(PYTEST) -m slow

# In one session: the tests are found and imported once, and no process waits for the last quick one.
test-all: kernels
	@$(PYTEST)

# Each process that runs tests would compile the kernels that it meets first.
kernels: .venv/tested
	@$(BIN)/python -m tests.support.compile_kernels

# Compiled kernels are not traced: they run as plain Python, except in the tests of the compiler.
coverage: .venv/tested
	$(BIN)/coverage erase
	NUMBA_DISABLE_JIT=1 $(BIN)/coverage run -m pytest -q -n $(WORKERS) --dist worksteal -m 'not slow or sampled' $(COVERED)
	$(BIN)/coverage run -m pytest -q tests/jit
	$(BIN)/coverage combine -q
	$(BIN)/coverage report

# Contains the machine code of all kernels, for two levels of x86-64: needs neither numba nor time.
wheel: .venv/installed
	$(BIN)/python -m tools.build_wheel
	@ls -l dist/*.whl

# The oldest and the newest numba that pyproject.toml allows.
test-numba: .venv/tested
	for version in 0.66 0.68; do \
	  $(PYTHON) -m venv build/numba-$$version && \
	  build/numba-$$version/bin/python -m pip install -q --disable-pip-version-check \
	    -e '.[test]' "numba==$$version.*" && \
	  NUMBA_CACHE_DIR=$(CURDIR)/build/numba-$$version/cache \
	    build/numba-$$version/bin/python -m pytest -q tests/jit tests/schemes/test_orders.py || exit 1; \
	done

mutate: .venv/tested
	$(BIN)/python tools/mutate.py

# make test generates the same examples every time, make fuzz new ones; -s prints their number.
fuzz: .venv/tested
	MSAHL_FUZZ_SECONDS=$(SECONDS) $(BIN)/python -m pytest -q -s tests/fuzz

lint: .venv/tested
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/python tools/check_words.py

regress: .venv/tested
	$(BIN)/python tools/regress.py check

regress-update: .venv/tested
	$(BIN)/python tools/regress.py update

sweep: $(SWEEP).csv

$(SWEEP).csv: $(SWEEP_RUNS) tools/sweep_table.py
	@$(BIN)/python tools/sweep_table.py $(dir $(SWEEP_RUNS)) > $@
	@echo 'table: $@'

# Exit status 1 is the verdict FAIL, which large steps have; their tables are complete. An interrupted
# sweep has no runs.csv yet, so make goes on with it.
define sweep_rule
$(SWEEP)/$(1)/runs.csv: decks/thesis/$(1).xml | .venv/installed
	$(BIN)/msahl sweep $$< --over dt=$(SWEEP_STEPS) --t-final 10 --keep all --jobs $(JOBS) -q -o $$(@D) || [ $$$$? -eq 1 ]
endef
$(foreach d,$(SWEEP_DECKS),$(eval $(call sweep_rule,$(d))))

bench: .venv/installed
	$(BIN)/python -m pip install -q -e '.[bench]'
	$(BIN)/python -m benchmarks.speed
	$(BIN)/python -m benchmarks.precision
	$(BIN)/python -m benchmarks.mechanisms.measure
	$(BIN)/python -m benchmarks.contact.measure
	$(BIN)/python -m benchmarks.beams.measure

# Compares every number that the thesis prints with the computed one.
thesis: .venv/installed
	$(BIN)/python -m tools.validation.thesis

validation: thesis error-table
	$(BIN)/python -m tools.validation.closed_forms
	$(BIN)/python -m tools.validation.orders
	$(BIN)/python -m benchmarks.convergence.experiment --page
	$(BIN)/python -m tools.validation.stability --page

# Takes about five minutes on two cores, and about ten more when reference solutions and kernels are new.
error-table: .venv/installed
	$(BIN)/python -m tools.validation.error

# Takes about an hour on two cores. make validation writes the page from docs/validation/stability.csv.
stability: .venv/installed
	$(BIN)/python -m tools.validation.stability

convergence: .venv/installed
	$(BIN)/python -m benchmarks.convergence.experiment

# Strict: a broken link or a page outside the navigation is an error.
docs: .venv/documented
	@NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict
	@echo 'site: $(SITE)/index.html'

examples: .venv/documented .venv/tested
	$(BIN)/python -m tools.docs.pictures
	$(BIN)/python -m tools.docs.gallery

readme: .venv/tested
	$(BIN)/python -m tools.docs.moving_picture

# The bundles in msahl/post/web come from the packages of tools/web/package-lock.json; to change them,
# edit package.json there and run node build.mjs.
web:
	@if command -v npm > /dev/null; then \
	  cd tools/web && npm ci --silent && node build.mjs --check; \
	else echo 'make web: node is not installed; the bundles were not compared'; fi

clean:
	rm -rf $(RESULTS) .coverage build dist .pytest_cache .mypy_cache .ruff_cache .hypothesis

.venv/installed: pyproject.toml setup.py
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install -q --disable-pip-version-check -e .
	@touch $@

.venv/tested: pyproject.toml setup.py
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install -q --disable-pip-version-check -e '.[test]'
	@touch .venv/installed $@

.venv/documented: .venv/installed
	$(BIN)/python -m pip install -q --disable-pip-version-check -e '.[docs]'
	@touch $@
