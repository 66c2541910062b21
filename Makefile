# Two commands do everything on a fresh machine: `make demo` and `make test`. `make` alone lists the rest.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
SEEDS := 10
WORKERS := 2
EXPERTS := $(foreach task,line eight passage garden corridor,camera:--task:$(task)) \
  $(foreach task,line passage garden,lidar:--task:$(task)) depth:--task:table-top
BENCHES := twin lockstep latency train preprocess step log drivers takeover web

# Where nothing is kept of what was compiled, each of hundreds of processes compiles it again.
unexport PYTHONDONTWRITEBYTECODE

.DEFAULT_GOAL := help
.PHONY: help setup foreign demo test test-fast test-long check docs generated bench results experts wheel clean

help: ## list what can be made
	@awk -F ':[^#]*## ' '/^[a-z-]+:.*## / {printf "  make %-10s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

setup: $(VENV)/.installed ## make .venv with everything that development needs

# The stamp is written last: whatever was interrupted before it is done again.
$(VENV)/.installed: pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
	  || { echo "Python 3.11 or newer is needed: make setup PYTHON=python3.11"; exit 1; }
	@$(BIN)/python -m pip --version >/dev/null 2>&1 || $(PYTHON) -m venv --clear $(VENV)
	@echo "installing into $(VENV): 3 GB, PyTorch above all, which takes some minutes"
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable '.[dev]'
	@-$(BIN)/python -m pytest --collect-only >/dev/null  # compiles all once, which else each of many processes does
	@touch $@

# Nothing of it is needed to use the project: tests that find none are skipped, and say so.
foreign: ## ROS 2, a peer of rmw_zenoh and Foxglove's decoders, for tests against them, into .foreign
	$(PYTHON) -m venv .foreign
	.foreign/bin/python -m pip install --quiet --requirement tests/support/foreign.txt
	npm install --silent --prefix .foreign @foxglove/rosmsg@5 @foxglove/rosmsg2-serialization@3

demo: setup ## teach a robot in the twin, from start to report
	$(BIN)/lira demo

test: setup ## every test: most beside each other, then those that need the machine for themselves
	$(BIN)/python tests/suite.py

test-long: setup ## a scripted person teaches to a pass in real time, by pad and by page: ten minutes or more, alone
	LIRA_LONG=1 $(BIN)/python -m pytest tests/tools/runs/test_taught_by_hand.py

test-fast: setup ## the unit tests, in under a minute
	$(BIN)/python -m pytest -m unit

check: setup ## ruff, mypy (strict), who may import whom
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/mypy examples/*.py
	$(BIN)/python -m pytest tests/test_layering.py

docs: setup ## the documentation, into site/; a warning fails it
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable '.[docs]'
	$(BIN)/zensical build --clean --strict

generated: setup ## what the documents take from the code: the map, the table of topics
	$(BIN)/python docs/generate.py --write

bench: setup ## all benchmarks but decide, fuzz, record, soak and trial, into runs/bench/; fails where a ratio in bench/history/ was far better
	@mkdir -p runs/bench
	@failed=0; for name in $(BENCHES); do \
	  $(BIN)/lira bench $$name --json runs/bench/$$name.json --history bench/history || failed=1; \
	done; exit $$failed

results: setup ## every experiment, then RESULTS.md and docs/results; goes on where it was stopped
	$(BIN)/lira experiment all --seeds $(SEEDS) --workers $(WORKERS)

# Each expert's header holds the command that made it.
experts: setup ## the experts that come with the project, from scratch
	@for expert in $(EXPERTS); do $(BIN)/lira train-expert $$(echo $$expert | tr : ' ') || exit 1; done

wheel: setup ## the wheel, into dist/
	$(BIN)/python -m pip wheel --quiet --no-deps --wheel-dir dist .

clean: ## forget .venv, runs/, site/ and what was built
	rm -rf $(VENV) .foreign runs site build dist
