# make run | test | oldest | lint | docs | dist | bench | clean. PYTHON=... chooses another interpreter, 3.11 or newer.
# make ecosystem runs both environments in the learning libraries, and writes the table of docs/ecosystem.md.
# make all-extras installs every optional dependency, so that no test is skipped.
# Paths are relative throughout, so that the path of the repository may hold spaces.
PYTHON ?= $(shell command -v python3.11 || command -v python3 || echo python3)
BIN := .venv/bin
LIBRARIES := .venv-ecosystem

# Constraints reach the environments that packages are built in only through the environment
# (pip 25.3 and newer read the second name there).
export PIP_CONSTRAINT := constraints.txt
export PIP_BUILD_CONSTRAINT := constraints.txt
export PIP_DISABLE_PIP_VERSION_CHECK := 1

.DELETE_ON_ERROR:
PYTEST_OPTIONS ?=

.PHONY: run test oldest lint docs dist bench ecosystem all-extras clean

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
	@$(BIN)/mypy

# the pages of docs/ as a site, site/index.html
docs: .venv/.docs
	@NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build -q

# wheel and source distribution, into dist/
dist: .venv/.dev
	@$(BIN)/python -m hatchling build -c -d dist

bench: .venv/.all
	@$(BIN)/python -m training.studies.speed --history docs/speed_history.jsonl
	@$(BIN)/python -m training.studies.speed_history
	@$(BIN)/python -m training.studies.filter_speed
	@$(BIN)/python -m training.studies.cold_start

# Libraries warn of themselves, so that warnings are no errors; whether all has passed the last line says.
REPORT := -W default -o junit_family=xunit1 --junit-xml
ecosystem: $(LIBRARIES)/current/.done $(LIBRARIES)/older/.done
	@rm -f $(LIBRARIES)/*.xml
	-@$(LIBRARIES)/current/bin/python -m pytest $(REPORT) $(LIBRARIES)/current.xml tests/ecosystem
	-@$(LIBRARIES)/older/bin/python -m pytest $(REPORT) $(LIBRARIES)/older.xml \
		tests/ecosystem/test_rllib.py tests/ecosystem/test_tianshou.py
	@$(LIBRARIES)/current/bin/python tests/ecosystem/write_table.py $(LIBRARIES)/current.xml $(LIBRARIES)/older.xml

all-extras: .venv/.all

.venv/.dev: pyproject.toml constraints.txt
	@"$(PYTHON)" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null || \
		{ echo "auv-fault needs Python 3.11 or newer, and $(PYTHON) is not: set PYTHON=/path/to/python3.11" >&2; exit 1; }
	@echo "Installing into .venv (about a minute) ..."
	@"$(PYTHON)" -m venv --clear .venv
	@$(BIN)/python -m pip install -qq -c constraints.txt -e ".[dev]"
	@touch $@

.venv/.docs: .venv/.dev
	@echo "Installing what builds the site into .venv ..."
	@$(BIN)/python -m pip install -qq -c constraints.txt -e ".[docs]"
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

$(LIBRARIES)/current/.done: tests/ecosystem/current.txt pyproject.toml constraints.txt
	@echo "Installing learning libraries into $(LIBRARIES)/current (some minutes) ..."
	@"$(PYTHON)" -m venv --clear $(LIBRARIES)/current
	@$(LIBRARIES)/current/bin/python -m pip install -qq -c constraints.txt -e . pytest -r tests/ecosystem/current.txt
	@touch $@

# What older.txt names at another version than constraints.txt comes from older.txt.
$(LIBRARIES)/older/.done: tests/ecosystem/older.txt pyproject.toml constraints.txt
	@echo "Installing learning libraries into $(LIBRARIES)/older (some minutes) ..."
	@"$(PYTHON)" -m venv --clear $(LIBRARIES)/older
	@sed -n 's/^\([a-z]*\)==.*/^\1==/p' tests/ecosystem/older.txt > $(LIBRARIES)/older/names.txt
	@grep -vif $(LIBRARIES)/older/names.txt constraints.txt > $(LIBRARIES)/older/constraints.txt
	@PIP_CONSTRAINT=$(LIBRARIES)/older/constraints.txt $(LIBRARIES)/older/bin/python -m pip install -qq -e . pytest \
		-r tests/ecosystem/older.txt
	@touch $@

clean:
	rm -rf .venv .venv-oldest $(LIBRARIES) runs dist site .hypothesis .pytest_cache .ruff_cache .mypy_cache .import_linter_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
