# Everything a fresh Debian or Ubuntu with Python 3.11 or 3.12 needs: `make demo`, `make test`.
# Only `setup` (pip) uses the network; every step is skipped when its stamp is newer than what it depends on.

SHELL := /bin/bash
.SHELLFLAGS := -e -o pipefail -c
.DEFAULT_GOAL := help
MAKEFLAGS += --no-print-directory

# A full ROS 2 in the calling shell would shadow the wheels; bytecode must be written while colcon builds.
unexport PYTHONPATH PYTHONHOME PYTHONDONTWRITEBYTECODE LD_LIBRARY_PATH _ROS_WHEELS_BOOTSTRAP_COMPLETE
unexport AMENT_PREFIX_PATH COLCON_PREFIX_PATH CMAKE_PREFIX_PATH ROS_DISTRO

VENV := .venv
PIP := $(VENV)/bin/python -m pip --disable-pip-version-check install --quiet --quiet $(PIP_ARGS) --constraint constraints.txt
ACTIVATE := source $(VENV)/bin/activate
WORKSPACE := $(ACTIVATE); source install/setup.bash
ROBOFISH := $(WORKSPACE); exec install/fish_report/lib/fish_report/robofish
SOURCES := $(shell find src -not -path '*/test*' -not -path '*/__pycache__*' -not -name '* *')
STUDIES := $(shell find studies/fish_study -not -path '*/test*' -not -path '*/__pycache__*' -not -name '* *')
# studies/COLCON_IGNORE keeps them out of a plain `colcon build`
WITH_STUDIES := --base-paths src studies/fish_study

# The first interpreter that really is 3.11 or 3.12 (a pyenv shim may exist and still not run).
PYTHON ?= $(shell for p in python3 python3.12 python3.11; do \
	$$p -c 'import sys; sys.exit(sys.version_info[:2] not in ((3, 11), (3, 12)))' >/dev/null 2>&1 && echo $$p && break; done)

# A misspelt variable, such as LETER=S, would change nothing and nobody would notice.
OURS := LETTER PATH_ARGS SPEED DURATION HARDWARE DOMAIN OUT VIEW ARGS DATASET PYTHON NOBLE_PYTHON NOBLE_SKIP PIP_ARGS SHELL VENV
UNKNOWN := $(filter-out $(OURS),$(foreach v,$(.VARIABLES),$(if $(findstring command line,$(origin $(v))),$(v))))
$(if $(UNKNOWN),$(error unknown variable $(UNKNOWN); known: $(OURS)))

.PHONY: help setup build demo test test-noble lint docs identify diagnose prove train evaluate paper clean distclean

help:
	@echo "make demo       the whole robot swims the letter R, is recorded, scored and shown; options:"
	@echo "                HARDWARE=fake  LETTER=S  SPEED=0.15  DURATION=20  LETTER=circle PATH_ARGS='{radius: 0.5}'  DOMAIN=7  OUT=folder  VIEW=1"
	@echo "make test       build, the tests of every package, the tests across packages"
	@echo "make test-noble the tests of every package but training, with the versions of Ubuntu 24.04"
	@echo "make identify, diagnose DATASET=folder   the model's parameters; the physics that it lacks"
	@echo "make prove      a short blind study: hidden effects, sealed labels, tables and a page; ARGS='--scenarios 300' for the long one"
	@echo "make train, evaluate, paper   learn the gains; how well they follow paths; the figures and the table of the paper"
	@echo "                results in out/NAME or OUT=folder; ARGS='...' goes to the command, ARGS=--help says more"
	@echo "make docs       the documentation as a site, docs/_build/html/index.html"
	@echo "make setup, build, lint, clean, distclean   the single steps"

# --- set-up: virtual environment and wheels -----------------------------------------------------------------------------
$(VENV)/.created:
	@[ -n "$(PYTHON)" ] || { echo "error: no Python 3.11 or 3.12 found; install one (apt install python3 python3-venv) or say make PYTHON=/path/to/python3.12" >&2; exit 1; }
	@$(PYTHON) -c 'import sys; v = sys.version_info[:2]; sys.exit(0 if v in ((3, 11), (3, 12)) else f"error: $(PYTHON) is Python {v[0]}.{v[1]}; this project needs 3.11 or 3.12")'
	@[ "$$(uname -sm)" = "Linux x86_64" ] || { echo "error: the ROS 2 wheels exist for Linux x86_64 only, this is $$(uname -sm); use the full ROS 2 Jazzy here (docs/how_to/full_ros.md)" >&2; exit 1; }
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null || { echo "error: $(PYTHON) has no venv module; install it: apt install python3-venv" >&2; exit 1; }
	@$(VENV)/bin/python -c '' 2>/dev/null || $(PYTHON) -m venv --clear $(VENV)
	@touch $@

$(VENV)/.run: requirements.txt constraints.txt $(VENV)/.created
	@echo "setup: wheels of requirements.txt (about a minute, or as long as your line takes)"
	@$(PIP) -r requirements.txt
	@touch $@

$(VENV)/.diagnose: requirements-diagnose.txt constraints.txt $(VENV)/.run
	@echo "setup: wheels of requirements-diagnose.txt"
	@$(PIP) -r requirements-diagnose.txt
	@touch $@

$(VENV)/.train: requirements-train.txt constraints.txt $(VENV)/.diagnose
	@echo "setup: wheels of requirements-train.txt"
	@$(PIP) -r requirements-train.txt
	@touch $@

$(VENV)/.dev: requirements-dev.txt constraints.txt $(VENV)/.train
	@echo "setup: wheels of requirements-dev.txt"
	@$(PIP) -r requirements-dev.txt
	@touch $@

$(VENV)/.docs: requirements-docs.txt constraints.txt $(VENV)/.diagnose
	@echo "setup: wheels of requirements-docs.txt"
	@$(PIP) -r requirements-docs.txt
	@touch $@

# With Python 3.12 `make test` also runs the tests with Ubuntu 24.04's versions; their wheels belong to the set-up.
setup: $(VENV)/.dev
	@if python3.12 -c '' 2>/dev/null; then $(MAKE) .noble/.run; fi

# --- build ----------------------------------------------------------------------------------------------------------------
# The command robofish in the environment's folder of commands runs colcon's executable, or says what to source.
install/.built: $(VENV)/.run colcon.meta $(SOURCES)
	@$(ACTIVATE); colcon build
	@ln -sfn ../../src/fish_report/bin/robofish $(VENV)/bin/robofish
	@touch $@

build: install/.built

# What is needed to check the robot's software, and not to run the robot.
install/.studies: install/.built $(STUDIES) $(VENV)/.diagnose
	@$(ACTIVATE); colcon build $(WITH_STUDIES) --packages-select fish_study
	@touch $@

# --- the robot and the tools ----------------------------------------------------------------------------------------------
demo: build
	@$(ROBOFISH) demo $(if $(LETTER),--letter '$(LETTER)') $(if $(PATH_ARGS),--path-args '$(PATH_ARGS)') $(if $(SPEED),--speed '$(SPEED)') \
		$(if $(HARDWARE),--hardware '$(HARDWARE)') $(if $(DURATION),--duration '$(DURATION)') $(if $(DOMAIN),--domain '$(DOMAIN)') $(if $(OUT),--out '$(OUT)') $(if $(VIEW),--view) $(ARGS)

# A few small scenarios; ARGS='--scenarios 300 --oracle' is the study. The same OUT goes on where it was stopped.
prove: install/.studies
	@$(ROBOFISH) prove --out '$(or $(OUT),out/prove)' $(or $(ARGS),--scenarios 4 --groups single sensor outside null --trials 6 --duration 8)

identify diagnose: build $(VENV)/.diagnose
	@$(ROBOFISH) $@ $(DATASET) --out '$(or $(OUT),out/$@)' $(ARGS)

evaluate: build $(VENV)/.diagnose
train: build $(VENV)/.train
paper: install/.studies $(VENV)/.train
train evaluate paper:
	@$(ROBOFISH) $@ --out '$(or $(OUT),out/$@)' $(ARGS)

# --- tests ----------------------------------------------------------------------------------------------------------------
# Parts that run three at a time on two cores, since tests with nodes wait now and then; the longest first. Tests that draw a
# free ROS domain are one part, one after the other: two would draw the same now and then. All others have domains of their own.
DRAW_A_DOMAIN := fish_bag
ALONE := fish_sysid fish_study fish_control fish_vision fish_hw fish_sim fish_train fish_node
PARTS := across $(ALONE) rest
test: setup install/.studies
	@status=0; $(MAKE) --jobs=3 --keep-going $(PARTS:%=.test/%) || status=1; \
		$(ACTIVATE); colcon test-result --all --verbose || status=1; \
		if python3.12 -c '' 2>/dev/null; then $(MAKE) test-noble || status=1; fi; exit $$status

COLCON_TEST = colcon --log-base log/$(@F) test $(WITH_STUDIES) --executor sequential --return-code-on-test-failure
.PHONY: $(PARTS:%=.test/%)
.test/across:
	@unset MAKEFLAGS MFLAGS; $(WORKSPACE); status=0; python -m pytest test || status=1; \
		$(COLCON_TEST) --packages-select $(DRAW_A_DOMAIN) || status=1; exit $$status
$(ALONE:%=.test/%): .test/%:
	@$(WORKSPACE); $(COLCON_TEST) --packages-select $*
# whatever package is not named above
.test/rest:
	@$(WORKSPACE); $(COLCON_TEST) --packages-skip $(DRAW_A_DOMAIN) $(ALONE)

# Ubuntu 24.04's versions of Python and of every library that rosdep installs there; all packages but training.
NOBLE := .noble
NOBLE_PYTHON ?= $(shell for p in python3.12 $(HOME)/.pyenv/versions/3.12*/bin/python3.12 $(PYTHON); do \
	$$p -c 'import ensurepip, venv' >/dev/null 2>&1 && echo $$p && break; done)
NOBLE_SKIP := fish_train fish_study
$(NOBLE)/.run: requirements-noble.txt requirements-ros.txt
	@[ -n "$(NOBLE_PYTHON)" ] || { echo "error: no Python 3.12 or 3.11 with venv found; say make test-noble NOBLE_PYTHON=/path/to/python3.12" >&2; exit 1; }
	@$(NOBLE_PYTHON) -m venv --clear $(NOBLE)/venv
	@echo "setup: wheels of requirements-noble.txt"
	@$(NOBLE)/venv/bin/python -m pip --disable-pip-version-check install --quiet --quiet $(PIP_ARGS) -r requirements-noble.txt
	@touch $@

test-noble: $(NOBLE)/.run
	@$(NOBLE)/venv/bin/python -c 'import sys; v = sys.version_info[:2]; v == (3, 12) or print(f"test-noble: Python {v[0]}.{v[1]} with the libraries of Ubuntu 24.04, which has 3.12")'
	@source $(NOBLE)/venv/bin/activate; colcon --log-base $(NOBLE)/log build --base-paths src --build-base $(NOBLE)/build --install-base $(NOBLE)/install
	@source $(NOBLE)/venv/bin/activate; source $(NOBLE)/install/setup.bash; status=0; \
		colcon --log-base $(NOBLE)/log test --base-paths src --build-base $(NOBLE)/build --install-base $(NOBLE)/install \
			--packages-skip $(NOBLE_SKIP) --executor sequential --return-code-on-test-failure || status=1; \
		colcon test-result --test-result-base $(NOBLE)/build --verbose || status=1; exit $$status

lint: setup
	@$(ACTIVATE); ruff format --check .; ruff check .; mypy src/*/fish_* studies/*/fish_* studies/*.py

# --- documentation --------------------------------------------------------------------------------------------------------
# The generated pages of docs/reference are written again first; a warning is an error.
docs: install/.studies $(VENV)/.docs
	@$(WORKSPACE); python docs/generate_reference.py; python -m sphinx -q -W --keep-going -b html docs docs/_build/html
	@echo "site: docs/_build/html/index.html"

clean:
	rm -rf docs/_build build install log $(NOBLE)/build $(NOBLE)/install $(NOBLE)/log

distclean: clean
	rm -rf $(VENV) $(NOBLE)
