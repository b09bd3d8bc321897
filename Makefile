# Two commands: `make demo` and `make test`. Both need nothing but Python 3.11+ and git.

PYTHON ?= python3
BIN := .venv/bin

.PHONY: demo test test-large lint clean

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

.venv/installed: pyproject.toml
	@echo "Installing miurafab and its libraries into .venv. This takes a minute."
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --editable .
	touch $@

.venv/installed-dev: pyproject.toml
	@echo "Installing miurafab and its development tools into .venv. This takes a minute or two."
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --editable ".[dev]"
	touch $@

clean:
	rm -rf .venv jobs dist build
