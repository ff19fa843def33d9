# make run and make test need Python 3.11 or newer and GNU make, nothing else: both set up .venv.

PYTHON ?= python3
DECK ?= decks/thesis/single_pendulum_45.xml

BIN := .venv/bin
RESULTS := results
# Processes the tests run in.
WORKERS ?= 2
# How long bad decks are tried out.
SECONDS ?= 300
OUT := $(RESULTS)/$(basename $(notdir $(DECK)))

SITE := build/site

# The thesis's tables 4.2 and 4.4: angles by steps, 10 s.
SWEEP := $(RESULTS)/sweep
SWEEP_DECKS := $(foreach n,single double,$(foreach a,45 89 135,$(n)_pendulum_$(a)))
SWEEP_STEPS := 0.1 0.04 0.01 0.004 0.002
SWEEP_RUNS := $(foreach d,$(SWEEP_DECKS),$(foreach h,$(SWEEP_STEPS),$(SWEEP)/$(d)/$(h)/states.csv))

.PHONY: help run test fuzz lint regress regress-update sweep bench thesis validation convergence \
  stability error-table docs examples clean
.DELETE_ON_ERROR:

help:
	@echo 'make run             set up .venv, run DECK ($(DECK)), write its report'
	@echo 'make test            set up .venv for tests; lint, compare stored results, run all tests'
	@echo 'make fuzz            try out bad decks for SECONDS ($(SECONDS))'
	@echo 'make lint            ruff and mypy'
	@echo 'make regress         run the stored cases again and compare with tests/regression'
	@echo 'make regress-update  write tests/regression anew and say what changed'
	@echo 'make sweep           angles by steps of the thesis -> $(SWEEP).csv (in parallel: make -j2 sweep)'
	@echo 'make bench           measure speed, and seconds to an error, against peers'
	@echo 'make thesis          write docs/validation/thesis.md (make validation: all its pages)'
	@echo 'make stability       run extreme scenes at all steps, write docs/validation/stability.md'
	@echo 'make error-table     compare error estimates with true errors, write docs/validation/error.md'
	@echo 'make docs            build the documentation site in $(SITE)'
	@echo 'make examples        run all decks and draw their pictures for the documentation'
	@echo 'make clean           remove results and build products; .venv stays'

run: .venv/installed
	$(BIN)/msahl run $(DECK) -o $(OUT)
	@$(BIN)/msahl-post report $(OUT) > /dev/null
	@echo 'tables:   $(OUT)/states.csv and others beside it'
	@echo 'report:   $(OUT)/report/report.html (or report.md)'
	@echo 'pictures: $(OUT)/report/'

# Tests come last, so that what they say in the end is the end.
test: lint regress
	@$(BIN)/python -m pytest -n $(WORKERS)

# What make test draws the same every time, drawn anew; -s shows how many there were.
fuzz: .venv/tested
	MSAHL_FUZZ_SECONDS=$(SECONDS) $(BIN)/python -m pytest -q -s tests/fuzz

lint: .venv/tested
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

regress: .venv/tested
	$(BIN)/python tools/regress.py check

regress-update: .venv/tested
	$(BIN)/python tools/regress.py update

sweep: $(SWEEP).csv

$(SWEEP).csv: $(SWEEP_RUNS) tools/sweep_table.py
	@$(BIN)/python tools/sweep_table.py $(SWEEP_RUNS) > $@
	@echo 'table: $@'

# Seconds in the table are those of a warm start: what compiles, once, is this.
$(SWEEP)/compiled: | .venv/installed
	$(BIN)/msahl run $(DECK) --t-final 0.01 -q -o $(SWEEP)/first
	@touch $@

# Exit status 1 is the verdict FAIL, as large steps have: the tables are complete.
# A run that was stopped has written run.json, but its tables have no names yet: it is made again.
define sweep_rule
$(SWEEP)/$(1)/$(2)/states.csv: decks/thesis/$(1).xml | $(SWEEP)/compiled
	$(BIN)/msahl run $$< --dt $(2) --t-final 10 -q -o $$(@D) || [ $$$$? -eq 1 ]
endef
$(foreach d,$(SWEEP_DECKS),$(foreach h,$(SWEEP_STEPS),$(eval $(call sweep_rule,$(d),$(h)))))

bench: .venv/installed
	$(BIN)/python -m pip install -q -e '.[bench]'
	$(BIN)/python -m benchmarks.speed
	$(BIN)/python -m benchmarks.precision

# Every printed number of the thesis beside ours, and the other pages of docs/validation.
thesis: .venv/installed
	$(BIN)/python -m tools.validation.thesis

validation: thesis error-table
	$(BIN)/python -m tools.validation.closed_forms
	$(BIN)/python -m tools.validation.orders
	$(BIN)/python -m benchmarks.convergence.experiment --page
	$(BIN)/python -m tools.validation.stability --page

# About five minutes on two cores; the first time reference solutions and kernels take five more each.
error-table: .venv/installed
	$(BIN)/python -m tools.validation.error

# An hour or so on two cores; make validation writes the page from the cells kept in docs/validation/stability.csv.
stability: .venv/installed
	$(BIN)/python -m tools.validation.stability

convergence: .venv/installed
	$(BIN)/python -m benchmarks.convergence.experiment

# Strict: a broken link or a page outside the navigation is an error.
docs: .venv/documented
	@NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict
	@echo 'site: $(SITE)/index.html'

examples: .venv/documented
	$(BIN)/python tools/docs/pictures.py

clean:
	rm -rf $(RESULTS) build dist .pytest_cache .mypy_cache .ruff_cache .hypothesis

.venv/installed: pyproject.toml
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install -q --disable-pip-version-check -e .
	@touch $@

.venv/tested: .venv/installed
	$(BIN)/python -m pip install -q --disable-pip-version-check -e '.[test]'
	@touch $@

.venv/documented: .venv/installed
	$(BIN)/python -m pip install -q --disable-pip-version-check -e '.[docs]'
	@touch $@
