# Two commands for a user: `make run` and `make test`. Both do all set-up; no root, nothing outside .venv and data/.
PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin

.DEFAULT_GOAL := help
.PHONY: help run test lint types contracts check constraints proto clean

help:               ## what can be made
	@grep -E '^[a-z]+: .*##' $(MAKEFILE_LIST) | sed -E 's/^([a-z]+):.*## /  make \1\t/'

$(VENV)/run.stamp: pyproject.toml constraints.txt
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python tools/install.py
	@touch $@

$(VENV)/dev.stamp: $(VENV)/run.stamp
	$(BIN)/python tools/install.py --extra dev
	@touch $@

run: $(VENV)/run.stamp            ## set up, then service and simulated fleet on 127.0.0.1:8000
	$(BIN)/wingwatch demo $(ARGS)

test: $(VENV)/dev.stamp           ## set up, then every check and test
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy -p wingwatch
	$(BIN)/mypy tests benchmarks
	$(BIN)/lint-imports
	$(BIN)/pytest -n 2

clean:                            ## remove the environment and caches (the data folder stays)
	rm -rf $(VENV) .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache
