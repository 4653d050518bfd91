# `make run` and `make test` set up .venv on first use.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready
# Threads cost more than they give on matrices of some ten rows.
export OPENBLAS_NUM_THREADS := 1
# The tests start hundreds of processes: without bytecode each of them compiles the packages anew.
unexport PYTHONDONTWRITEBYTECODE

LINT := $(BIN)/ruff format --check . && $(BIN)/ruff check . && $(BIN)/lint-imports --no-cache
# Types take one processor half a minute: they are checked beside the rest, and what there is to say comes last.
define beside_types
	types=$$(mktemp) || exit; $(BIN)/mypy > "$$types" 2>&1 & checked=$$!; \
	$(1); status=$$?; \
	wait $$checked || status=1; cat "$$types"; rm "$$types"; exit $$status
endef

.PHONY: run test test-long faults benchmark docs notebooks lint format clean

run: $(READY)
	$(BIN)/hybrid-fmu paper --out results

# Neighbours in a file share what they make, so each process begins with tests that lie together.
test: $(READY)
	$(call beside_types,$(LINT) && $(BIN)/python -m pytest -n 2 --dist worksteal -m "not long and not faults")

# Also draws fresh cases for the tests that draw any; SEED=N draws those of an earlier run again.
SEED ?= $(shell od -An -N4 -tu4 /dev/urandom | tr -d ' ')
test-long: SEED := $(SEED)
test-long: $(READY)
	@echo "drawing with the seed $(SEED); the same draws again: make test-long SEED=$(SEED)"
	$(BIN)/python -m pytest -n 2 -m "(long or hypothesis) and not faults" --hypothesis-profile=fresh --hypothesis-seed=$(SEED)

# Needs valgrind and the sanitizers of gcc or clang.
faults: $(READY)
	$(BIN)/python -m pytest -n 2 -m faults

# Prints the tables of docs/benchmarks.md.
benchmark: $(READY)
	PIP_CONSTRAINT=constraints.txt $(BIN)/pip install --quiet --disable-pip-version-check -e ".[benchmark]"
	PYTHONPATH=tests $(BIN)/python -m benchmarks
	PYTHONPATH=tests $(BIN)/python -m benchmarks.step_cost

# The site, readable without a network: build/site/index.html.
docs: $(READY)
	$(BIN)/sphinx-build -W --keep-going -q docs build/site

# Runs the scripts in notebooks/ and keeps what they show in the files beside them.
notebooks: $(READY)
	$(BIN)/python tests/support/notebook_run.py

lint: $(READY)
	$(call beside_types,$(LINT))

format: $(READY)
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

$(READY): pyproject.toml constraints.txt
	@echo "Setting up $(VENV) with the packages of constraints.txt: some two minutes, the first time only."
	$(PYTHON) -m venv $(VENV)
	PIP_CONSTRAINT=constraints.txt $(BIN)/pip install --quiet --disable-pip-version-check -e ".[dev]"
	touch $(READY)

clean:
	rm -rf $(VENV) results build
