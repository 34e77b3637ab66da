# Two commands for a user: `make run` and `make test`. Both do all set-up; no root, nothing outside .venv and data/.
PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
SETUP  := $(PYTHON) tools/install.py

# Set in many containers: each start of Python would then compile all that it imports, four seconds of processor time.
unexport PYTHONDONTWRITEBYTECODE

.DEFAULT_GOAL := help
.PHONY: help python run test checks kernels constraints proto wheel docs reference sbom clean

help:         ## what can be made
	@grep -E '^[a-z]+:.*##' Makefile | sed -E 's/^([a-z]+):.*## (.*)/\1|\2/' | while IFS='|' read -r name text; do \
	  printf '  make %-12s %s\n' "$$name" "$$text"; done

python:
	@command -v "$(PYTHON)" >/dev/null || { \
	  echo "wingwatch set-up: there is no '$(PYTHON)' on this machine: install Python 3.11 or newer, or name one with PYTHON=" >&2; \
	  exit 2; }

run: python   ## set up, then the service and a simulated fleet on 127.0.0.1:8000 (ARGS="--port 8010" and so on)
	@$(SETUP)
	@$(BIN)/wingwatch demo $(ARGS)

# Three processes test side by side, for many tests wait; each with one thread.
test: export OPENBLAS_NUM_THREADS = 1
test: python  ## set up, then every check and test
	@$(SETUP) --extra dev --extra postgres --extra dask --extra logs --extra notify --extra docs
	@$(MAKE) --no-print-directory -j 2 checks kernels
	$(BIN)/pytest -n 3 --dist worksteal

checks:
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy wingwatch tests benchmarks tools examples
	$(BIN)/lint-imports

kernels:
	@$(BIN)/wingwatch kernels

# Pins stay where they can; `make constraints UPGRADE=--upgrade` takes the newest of everything.
constraints: python  ## pin every package anew, with hashes (UPGRADE=--upgrade for the newest)
	@$(SETUP) --extra dev
	CUSTOM_COMPILE_COMMAND="make constraints" $(BIN)/pip-compile $(UPGRADE) --quiet --generate-hashes --all-extras \
	  --allow-unsafe --strip-extras --annotation-style=line --no-emit-index-url --no-emit-trusted-host \
	  --no-emit-find-links --output-file constraints.txt pyproject.toml

proto: python ## generate telemetry/protocol from proto/
	@$(SETUP) --extra dev --extra postgres --extra dask --extra logs --extra notify --extra docs
	$(BIN)/python tools/generate_protocol.py

wheel: python ## a wheel in dist/ that starts at once: with the kernels, compiled
	@$(SETUP) --extra dev --extra postgres --extra dask --extra logs --extra notify --extra docs
	$(BIN)/python tools/wheel.py

docs: export NO_MKDOCS_2_WARNING = 1
docs: python  ## the documents as a site in dist/site, which a running service shows at /help
	@$(SETUP) --extra dev --extra postgres --extra dask --extra logs --extra notify --extra docs
	$(BIN)/mkdocs build --quiet
	@echo "dist/site/index.html"

reference: python ## docs/reference: options of the commands and operations of REST, from the code
	@$(SETUP) --extra dev --extra postgres --extra dask --extra logs --extra notify --extra docs
	$(BIN)/python tools/reference.py

sbom: python  ## bill of materials (CycloneDX) and licences of what the program needs, in dist/
	@$(SETUP) --extra dev --extra postgres --extra dask --extra logs --extra notify --extra docs
	@$(BIN)/python tools/sbom.py $(ARGS)

clean:        ## remove the environment and the caches (the data folder stays)
	rm -rf $(VENV) .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache dist build
