# Two commands do everything on a fresh machine: `make demo` and `make test`.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
SEEDS := 10
WORKERS := 2
EXPERTS := $(foreach task,line eight passage garden corridor,camera:--task:$(task)) \
  $(foreach task,line passage garden,lidar:--task:$(task))
BENCHES := twin lockstep latency train preprocess step log drivers takeover

.PHONY: setup demo test check bench results experts clean

setup: $(VENV)/.installed

# The stamp is written last: whatever was interrupted before it is done again.
$(VENV)/.installed: pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
	  || { echo "Python 3.11 or newer is needed: make setup PYTHON=python3.11"; exit 1; }
	@$(BIN)/python -m pip --version >/dev/null 2>&1 || $(PYTHON) -m venv --clear $(VENV)
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable '.[dev]'
	@touch $@

demo: setup
	$(BIN)/lira demo

test: setup
	$(BIN)/python -m pytest

check: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/python -m pytest tests/test_layering.py

bench: setup
	@mkdir -p runs/bench
	@for name in $(BENCHES); do $(BIN)/lira bench $$name --json runs/bench/$$name.json || exit 1; done

# Every experiment of the thesis, then RESULTS.md. It goes on where it was stopped.
results: setup
	$(BIN)/lira experiment all --seeds $(SEEDS) --workers $(WORKERS)

# The experts that come with the project, from scratch; each file's header holds the command that made it.
experts: setup
	@for expert in $(EXPERTS); do $(BIN)/lira train-expert $$(echo $$expert | tr : ' ') || exit 1; done

clean:
	rm -rf $(VENV) runs
