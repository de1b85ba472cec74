# Everything a fresh clone needs: `make reproduce`, `make test`, `make validate`. Each sets itself up.

PYTHON ?= python3
VENV ?= .venv
OUT ?= out/reproduce
SEEDS ?= 10
PYTEST_ARGS ?=

BIN := $(VENV)/bin
READY := $(VENV)/.ready

.PHONY: setup reproduce test validate lint clean

setup: $(READY)

$(READY): requirements.txt pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null || { \
		echo "Python 3.11 or newer is needed; $(PYTHON) is $$($(PYTHON) --version 2>&1 || echo not there)."; \
		echo "Name another one: make PYTHON=python3.12"; exit 1; }
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --requirement requirements.txt
	$(BIN)/python -m pip install --quiet --no-deps --editable .
	@touch $@

# Runs all scenarios of the papers, judges all claims, draws all figures into $(OUT).
reproduce: $(READY)
	$(BIN)/flocking reproduce --seeds $(SEEDS) --out $(OUT)

test: $(READY)
	$(BIN)/python -m pytest $(PYTEST_ARGS)

# The slow tests: many seeds, long runs, the package built and installed anew.
validate: $(READY)
	$(BIN)/python -m pytest -m slow $(PYTEST_ARGS)

lint: $(READY)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

clean:
	rm -rf $(VENV) build dist out
