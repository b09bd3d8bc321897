# Two commands: `make demo` and `make test`. Both need nothing but Python 3.11+ and git.

PYTHON ?= python3
BIN := .venv/bin

LOCKED := $(BIN)/python -m pip install --quiet --require-hashes --requirement
OURS := $(BIN)/python -m pip install --quiet --no-deps --no-build-isolation --editable .
COMPILE = $(BIN)/uv pip compile --quiet --universal --python-version 3.11 --generate-hashes --no-header

.PHONY: demo test test-large lint lock audit sbom clean

demo: .venv/installed
	$(BIN)/miurafab cut patterns/hypar.toml --port virtual
	$(BIN)/miurafab check jobs/hypar --rebuild
	@echo "How to glue it: jobs/hypar/assembly.pdf. Pictures of the sheets: $(BIN)/miurafab preview jobs/hypar"

test: .venv/installed-dev
	$(BIN)/python -m pytest -n 2

test-large: .venv/installed-dev
	$(BIN)/python -m pytest -n 2 -m large

lint: .venv/installed-dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

# The versions and hashes of all libraries are in locks/; `make lock` writes them anew.
.venv/installed: pyproject.toml locks/run.txt
	@echo "Installing miurafab and its libraries into .venv. This takes a minute."
	$(PYTHON) -m venv .venv
	$(LOCKED) locks/run.txt
	$(OURS)
	touch $@

.venv/installed-dev: pyproject.toml locks/dev.txt
	@echo "Installing miurafab and its development tools into .venv. This takes a minute or two."
	$(PYTHON) -m venv .venv
	$(LOCKED) locks/dev.txt
	$(OURS)
	touch $@

lock: .venv/installed-dev
	$(BIN)/python -m pip install --quiet uv
	$(COMPILE) --upgrade pyproject.toml locks/build.in --output-file locks/run.txt
	$(COMPILE) --upgrade pyproject.toml locks/build.in --extra dev --constraints locks/run.txt --output-file locks/dev.txt
	npm update --prefix tests/interop --package-lock-only --no-audit --no-fund

# Asks the vulnerability service of PyPI, and so needs the network.
audit: .venv/installed-dev
	$(BIN)/python -m pip install --quiet pip-audit
	$(BIN)/pip-audit --disable-pip --require-hashes --requirement locks/dev.txt

sbom:
	$(PYTHON) locks/sbom.py

clean:
	rm -rf .venv jobs dist build
