# make run | test | oldest | lint | bench | clean. PYTHON=... chooses another interpreter, 3.11 or newer.
# make all-extras installs every optional dependency, so that no test is skipped.
# Paths are relative throughout, so that the path of the repository may hold spaces.
PYTHON ?= $(shell command -v python3.11 || command -v python3 || echo python3)
BIN := .venv/bin

# Constraints reach the environments that packages are built in only through the environment
# (pip 25.3 and newer read the second name there).
export PIP_CONSTRAINT := constraints.txt
export PIP_BUILD_CONSTRAINT := constraints.txt
export PIP_DISABLE_PIP_VERSION_CHECK := 1

.DELETE_ON_ERROR:
PYTEST_OPTIONS ?=

.PHONY: run test oldest lint bench all-extras clean

run: .venv/.dev
	@$(BIN)/auv-fault reproduce --output runs/reproduce

test: .venv/.dev
	@$(BIN)/python -m pytest -n auto --dist loadfile $(PYTEST_OPTIONS)

# the oldest versions that pyproject.toml allows, in an environment of their own
oldest: .venv-oldest/.all
	@.venv-oldest/bin/python -m pytest -q -W default tests/test_oldest_versions.py

lint: .venv/.dev
	@$(BIN)/ruff check .
	@$(BIN)/ruff format --check .
	@$(BIN)/lint-imports --no-logo

bench: .venv/.all
	@$(BIN)/python -m training.studies.speed
	@$(BIN)/python -m training.studies.filter_speed

all-extras: .venv/.all

.venv/.dev: pyproject.toml constraints.txt
	@"$(PYTHON)" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null || \
		{ echo "auv-fault needs Python 3.11 or newer, and $(PYTHON) is not: set PYTHON=/path/to/python3.11" >&2; exit 1; }
	@echo "Installing into .venv (about a minute) ..."
	@"$(PYTHON)" -m venv --clear .venv
	@$(BIN)/python -m pip install -qq -c constraints.txt -e ".[dev]"
	@touch $@

.venv/.all: .venv/.dev
	@echo "Installing every extra into .venv (about a minute) ..."
	@$(BIN)/python -m pip install -qq -c constraints.txt -e ".[dev,bench,distributed]"
	@touch $@

oldest: export PIP_CONSTRAINT := constraints-oldest.txt
oldest: export PIP_BUILD_CONSTRAINT := constraints-oldest.txt
.venv-oldest/.all: pyproject.toml constraints-oldest.txt
	@echo "Installing the oldest versions into .venv-oldest (about a minute) ..."
	@"$(PYTHON)" -m venv --clear .venv-oldest
	@.venv-oldest/bin/python -m pip install -qq -c constraints-oldest.txt -e ".[dev,bench,distributed]"
	@touch $@

clean:
	rm -rf .venv .venv-oldest runs dist .hypothesis .pytest_cache .ruff_cache .import_linter_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
