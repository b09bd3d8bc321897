# Two commands: `make demo` and `make test`. Both need nothing but Python 3.11+ and git.

PYTHON ?= python3
BIN := .venv/bin

# Bytecode is kept: three workers and some hundred children would compile all modules anew.
export PYTHONDONTWRITEBYTECODE :=

SHELL := bash
.SHELLFLAGS := -o pipefail -c
SHOWN := | sed -u -n 's/^Collecting \([^=]*\).*/  \1/p; s/^Installing collected .*/Unpacking them./p'
LOCKED := $(BIN)/python -m pip install --require-hashes --requirement
OURS := $(BIN)/python -m pip install --quiet --no-deps --no-build-isolation --editable .
TOOLS := .venv/tools
COMPILE = $(TOOLS)/bin/uv pip compile --quiet --universal --python-version 3.11 --generate-hashes --no-header --upgrade
AUDIT = $(TOOLS)/bin/pip-audit --strict --disable-pip --require-hashes

.PHONY: demo test test-large coverage lint gallery docs benchmark mutants lock audit sbom clean

demo: .venv/installed
	$(BIN)/miurafab cut patterns/hypar.toml --port virtual
	$(BIN)/miurafab check jobs/hypar --rebuild
	@echo "How to glue it: jobs/hypar/assembly.pdf. Pictures of the sheets: $(BIN)/miurafab preview jobs/hypar"

test: .venv/installed-dev
	$(BIN)/python -m pytest -n 3

test-large: .venv/installed-dev
	$(BIN)/python -m pytest -n 3 -m large

# The branches of the package that the tests take. It fails under 95 in a hundred.
coverage: .venv/installed-dev
	rm -rf .coverage
	$(BIN)/coverage run -m pytest -n 3
	$(BIN)/coverage combine --quiet
	$(BIN)/coverage json --quiet
	$(BIN)/python .ci/branches.py .coverage/report.json

lint: .venv/installed-dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

# Fits, lays out and draws all that docs/gallery.md shows.
gallery: .venv/installed-dev
	$(BIN)/python benchmarks/gallery.py
	$(BIN)/python benchmarks/gallery.py --front

# Runs all benchmarks, in some 20 minutes, and writes docs/benchmarks.md. Rivals are in the extra bench.
benchmark: .venv/installed-dev
	$(BIN)/python benchmarks/table.py

# Puts faults into the modules of `[tool.mutants]` in pyproject.toml and tells which of them no test
# sees; `make mutants AREA=tabs` for one area.
mutants: .venv/installed-dev $(TOOLS)/installed
	$(BIN)/python .ci/mutants.py $(AREA)

# Makes a site of docs/ in site/, and fails on any warning.
docs: .venv/installed-dev
	$(BIN)/zensical build --clean --strict

# Builds wheel and sdist, installs them with pip, uv and pipx into each Python that is promised and
# there, and runs the first commands; it needs the network.
packages: .venv/installed-dev $(TOOLS)/installed
	$(BIN)/python .ci/packages.py

# The versions and hashes of all libraries are in locks/; `make lock` writes them anew.
.venv/installed: pyproject.toml locks/run.txt
	@echo "Installing miurafab and its libraries into .venv. This takes a minute."
	$(PYTHON) -m venv .venv
	$(LOCKED) locks/run.txt $(SHOWN)
	@echo "Installed. The first job:"
	$(OURS)
	touch $@

.venv/installed-dev: pyproject.toml locks/dev.txt
	@echo "Installing miurafab and its development tools into .venv. This takes a minute or two."
	$(PYTHON) -m venv .venv
	$(LOCKED) locks/dev.txt $(SHOWN)
	$(OURS)
	touch $@

# The programs that write and judge the lock files and list faults, in an environment of their own.
$(TOOLS)/installed: locks/tools.txt
	$(PYTHON) -m venv $(TOOLS)
	$(TOOLS)/bin/python -m pip install --quiet --require-hashes --requirement locks/tools.txt
	touch $@

lock: $(TOOLS)/installed
	$(COMPILE) locks/tools.in --output-file locks/tools.txt
	$(COMPILE) pyproject.toml locks/build.in --output-file locks/run.txt
	$(COMPILE) pyproject.toml locks/build.in --extra dev --constraints locks/run.txt --output-file locks/dev.txt
	$(COMPILE) pyproject.toml --extra cluster --extra host --extra layers --extra step --constraints locks/dev.txt --output-file locks/extras.txt
	$(COMPILE) pyproject.toml --extra bench --constraints locks/dev.txt --output-file locks/bench.txt
	npm update --prefix tests/interop --package-lock-only --no-audit --no-fund

# Asks the services of PyPI and npm for known weaknesses, and so needs the network. It fails where
# one of them cannot tell of a single library.
audit: $(TOOLS)/installed
	$(AUDIT) --requirement locks/dev.txt
	$(AUDIT) --requirement locks/extras.txt
	$(AUDIT) --requirement locks/bench.txt
	$(AUDIT) --requirement locks/tools.txt
	npm audit --prefix tests/interop --package-lock-only

sbom:
	$(PYTHON) locks/sbom.py

clean:
	rm -rf .venv jobs dist build site
