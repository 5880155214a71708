# Everything runs in .venv, made from constraints.txt. `make` lists the targets.
PYTHON ?= python3
VENV := .venv
RUN := $(VENV)/bin/python
STAMP := $(VENV)/.installed
SOURCES := $(wildcard sim/*.py sim/*/*.py)

# uv installs what constraints.txt pins and refuses files of other hashes. It reads no settings of pip, so the folder
# of wheels that pip knows is handed on.
LINKS = $(or $(PIP_FIND_LINKS),$(shell $(PYTHON) -m pip config get global.find-links 2>/dev/null))
UV = $(if $(LINKS),UV_FIND_LINKS="$(LINKS)") UV_SYSTEM_CERTS=1 $(VENV)/bin/uv
INSTALL = $(UV) pip install --quiet --python $(RUN) --constraints constraints.txt --build-constraints constraints.txt

CONFIG ?=
DATA ?= data/sweep
MODEL ?= models/model.safetensors
ROBOT ?= paper-control
PLANPATH ?= square:3l
TABLE ?=
ROWS ?=
DEVICE ?= cpu
OUT ?= reports/dataset.html

# Batches are the parallelism: one thread a process.
export OMP_NUM_THREADS ?= 1
export MKL_NUM_THREADS ?= 1

# Tests run in a process for each core. Each test belongs to exactly one of test, test-rest and test-rates.
PYTEST := -m pytest -n auto --dist worksteal

.DEFAULT_GOAL := help
.PHONY: help setup constraints demo test test-rest test-rates quick lint docs dataset train plan calibrate report bench clean

help: ## list the targets
	@grep -hE '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/^([a-z-]+):.*## (.*)/  make \1\t\2/' | expand -t 20

# The simulator's loops take longest, in two processes; the others use what these leave of the processors.
setup: $(STAMP) ## make .venv, install everything, pinned, and compile all loops
$(STAMP): pyproject.toml constraints.txt | $(VENV)/bin/uv
	$(INSTALL) -e '.[dev]'
	nice -n 10 $(RUN) -m planner compile & planner=$$!; \
	nice -n 10 $(RUN) -m calibration compile & swims=$$!; \
	$(RUN) -m sim compile && wait $$planner && wait $$swims
	touch $@
$(VENV)/bin/uv: constraints.txt
	$(PYTHON) -m venv $(VENV)
	sed -n '/^uv==/,/[^\]$$/p' constraints.txt > $(VENV)/uv.txt
	$(VENV)/bin/pip install --quiet --disable-pip-version-check --require-hashes --no-deps -r $(VENV)/uv.txt
	touch $@

demo: reports/demo.html ## the whole pipeline on the paper's robot, ends with reports/demo.html
reports/demo.html: $(STAMP) $(SOURCES) $(wildcard $(foreach p,camera dataset surrogate planner calibration softflagella,$(p)/*.py $(p)/*/*.py) surrogate/shipped/*) softflagella/demo.toml
	$(RUN) -m softflagella demo --out $@

test: $(VENV)/.extras ## run the tests of every feature
	$(RUN) $(PYTEST) -m "not (rest or rates)"
test-rest: $(VENV)/.extras ## run clusters and the longer tests
	$(RUN) $(PYTEST) -m "rest and not rates"
test-rates: $(VENV)/.extras ## count claims and coverage over many tables, robots and paths
	$(RUN) $(PYTEST) -m rates
$(VENV)/.extras: $(STAMP)
	$(INSTALL) -e '.[clusters,page,hdf5,dxf,gym,camera,boards]'
	touch $@

quick: $(STAMP) ## run the quick tests
	$(RUN) $(PYTEST) -m "not (slow or rest or rates)"

constraints: $(VENV)/bin/uv ## pin what pyproject.toml needs, with hashes (UPGRADE=1: the newest versions)
	$(RUN) -c 'import tomllib; print(*tomllib.load(open("pyproject.toml", "rb"))["build-system"]["requires"])' \
	| $(UV) pip compile --quiet pyproject.toml - --extra dev --extra clusters --extra docs --extra page --extra hdf5 --extra gym --extra camera --extra dxf --extra boards --extra peers --universal --generate-hashes \
	--no-annotate --custom-compile-command 'make constraints' $(if $(UPGRADE),--upgrade) -o constraints.txt

lint: $(STAMP) ## style, types; prints the lines of each package
	$(VENV)/bin/ruff check .
	$(VENV)/bin/ruff format --check .
	$(VENV)/bin/mypy
	@git grep -c '' -- '*.py' '*.pyi' '*.js' '*.c' '*.h' '*.html' '*.css' '*.j2' \
	| awk -F '[/:]' '{lines[$$1] += $$NF} END {for (part in lines) printf "%7d lines in %s\n", lines[part], part}' | sort -k 4

docs: $(VENV)/.docs ## the documentation as pages, docs/_build/html/index.html
	$(RUN) -m sphinx -q -W --keep-going -b html docs docs/_build/html
	@echo "-> docs/_build/html/index.html"
$(VENV)/.docs: $(STAMP)
	$(INSTALL) -e '.[docs]'
	touch $@

# Without CONFIG: the sweep that comes with the package. The build itself knows its sources and what is missing, so it
# always runs. It leaves the manifest of a finished data set alone, so that `make train` does not run again.
dataset: $(STAMP) ## simulate CONFIG into DATA (goes on where it stopped; ROWS=… for more or fewer rows)
	$(RUN) -m dataset build $(if $(CONFIG),--config "$(CONFIG)") --out "$(DATA)" $(if $(ROWS),--rows $(ROWS))
$(DATA)/manifest.json:
	$(MAKE) dataset

train: $(MODEL) ## train the look-up table MODEL on DATA (DEVICE=cuda or auto)
$(MODEL): $(DATA)/manifest.json
	$(RUN) -m surrogate train $(DATA) --out $(MODEL) --device $(DEVICE)

plan: $(STAMP) ## plan PLANPATH for ROBOT into reports/plan
	$(RUN) -m planner plan $(PLANPATH) --robot $(ROBOT) --out reports/plan

calibrate: $(STAMP) ## close the loop on TABLE=… for ROBOT into reports/calibration
	@test -n "$(TABLE)" || { echo "error: no table; write make calibrate TABLE=runs.csv ROBOT=robot.toml" >&2; exit 2; }
	$(RUN) -m softflagella calibrate "$(TABLE)" --robot "$(ROBOT)" --out reports/calibration

report: $(DATA)/manifest.json ## picture page of DATA into OUT
	$(RUN) -m dataset report "$(DATA)" --out "$(OUT)"

bench: $(STAMP) ## the figures that the README claims
	$(RUN) -m benchmarks --claimed

clean: ## remove what the pipeline made (not .venv)
	rm -rf data models reports docs/_build
