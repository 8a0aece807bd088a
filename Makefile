# Everything here needs nothing but a POSIX shell and Python 3.11 or newer with its venv module.
PYTHON ?= $(shell for p in python3 python3.13 python3.12 python3.11 python; do \
	if $$p -c 'import sys; sys.exit(sys.version_info < (3, 11))' >/dev/null 2>&1; then echo $$p; break; fi; done)
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.footfall-installed
EXTRAS ?= train,dev,docs
INSTALL ?= $(BIN)/python -m pip install --quiet --disable-pip-version-check
WORKERS ?= 2
TESTS ?= tests

.PHONY: help setup test demo docs lint format types clean

help:
	@echo "make setup   prepare .venv with the footfall command in it"
	@echo "make demo    train, export, deploy, compare: ends with an HTML report"
	@echo "make docs    build the documentation site in build/site"
	@echo "make test    run the tests (TESTS=tests/robots for some of them)"
	@echo "make lint    check style; make format applies it"
	@echo "make types   check types"
	@echo "make clean   remove .venv, caches and build leftovers; runs and reports stay"

setup: $(STAMP)

$(STAMP): pyproject.toml
	@test -n "$(PYTHON)" || { echo "footfall needs Python 3.11 or newer: install it, or run make PYTHON=/path/to/python" >&2; exit 2; }
	@test -d src/footfall/train || { echo "src/footfall/train is no link to train/: unpack or clone footfall where there are symbolic links" >&2; exit 2; }
	$(PYTHON) -m venv $(VENV)
	$(INSTALL) --editable '.[$(EXTRAS)]'
	@touch $(STAMP)

# Workers of one thread each: MuJoCo, XLA and BLAS would otherwise fight over the cores. Which files' tests are
# begun first, and which stay together in a worker, is settled in tests/support/file_order.py.
test: $(STAMP)
	OMP_NUM_THREADS=1 $(BIN)/python -m pytest -n $(WORKERS) --no-loadscope-reorder $(TESTS)

demo: $(STAMP)
	$(BIN)/footfall demo

docs: $(STAMP)
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --quiet --strict

lint: $(STAMP)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

format: $(STAMP)
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

types: $(STAMP)
	$(BIN)/mypy --num-workers $(WORKERS)

clean:
	rm -rf $(VENV) .cache .pytest_cache .mypy_cache .ruff_cache .hypothesis build dist src/*.egg-info
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
