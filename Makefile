# make demo : the main job on a synthetic traverse, a few queries, a picture of the map, what the simulation lacks, a drive without a microphone, all in demo/
# make test : the tests; make slow : those marked slow, on real recordings (../shared/data)
# make models : train the models that come with the package anew, from the recordings in ../shared/data (four minutes)
# make docs : the documentation site, in docs/_build
# All make their own virtual environment in .venv and install there; a second call installs only what changed.
# PYTHON=python3.12 takes another Python, VENV=folder another environment.

PYTHON ?= python3
VENV ?= .venv
WORKERS ?= auto
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check -q
CODE := $(shell find __init__.py framework vision audio identification database -name '*.py') $(wildcard framework/core/trained/*)
ABOUT := pyproject.toml requirements.lock

.PHONY: demo test slow benchmark models lint docs clean
.DEFAULT_GOAL := demo

demo: $(VENV)/.installed
	@mkdir -p demo
	@if [ -d demo/recording ]; then echo "==> demo/recording is there already"; else \
	  echo "==> a synthetic traverse: demo/recording"; $(BIN)/bevameter scenario demo demo/recording; fi
	@echo "==> the main job: demo/recording into demo/terrain.db"
	@$(BIN)/bevameter run demo/recording --db demo/terrain.db
	@echo; echo "==> what was learnt of each class: bevameter query classes"
	@$(BIN)/bevameter query classes --db demo/terrain.db
	@echo; echo "==> what the ground at a place can bear: bevameter query at 0 5"
	@$(BIN)/bevameter query at 0 5 --db demo/terrain.db
	@echo; echo "==> ground around a place: bevameter query near -7 41 --radius 1"
	@$(BIN)/bevameter query near -7 41 --radius 1 --db demo/terrain.db
	@echo; echo "==> the map: demo/map.png"
	@$(BIN)/bevameter map --db demo/terrain.db --track demo/recording --out demo/map.png
	@echo; echo "==> what the simulation lacks, with pictures in demo/why.html: bevameter explain demo/recording --db demo/terrain.db"
	@$(BIN)/bevameter explain demo/recording --db demo/terrain.db --report demo/why.html
	@echo
	@if [ -d demo/camera-imu ]; then echo "==> demo/camera-imu is there already"; else \
	  echo "==> a drive with camera and inertial sensor, no microphone: demo/camera-imu"; $(BIN)/bevameter scenario camera-imu demo/camera-imu; fi
	@echo "==> what each sense names rightly, and both together: demo/camera-imu into demo/camera-imu.db"
	@$(BIN)/bevameter run demo/camera-imu --db demo/camera-imu.db

test: $(VENV)/.installed-for-tests
	@echo "==> tests"
	@OMP_NUM_THREADS=1 $(BIN)/python -P -m pytest -n $(WORKERS) --maxprocesses 4 --dist loadfile --benchmark-disable

slow: $(VENV)/.installed-for-tests
	@echo "==> slow tests"
	@OMP_NUM_THREADS=1 $(BIN)/python -P -m pytest -m slow -n $(WORKERS) --maxprocesses 4 --benchmark-disable

benchmark: $(VENV)/.installed-for-tests
	@echo "==> benchmarks, which want a quiet machine"
	@$(BIN)/python -P -m pytest tests/benchmarks -m "" --benchmark-only --benchmark-json $(VENV)/benchmarks.json
	@$(BIN)/python tests/studies/measured.py $(VENV)/benchmarks.json

models: $(VENV)/.installed
	@echo "==> the models that come with the package: framework/core/trained"
	@OMP_NUM_THREADS=1 $(BIN)/python tests/studies/shipped_models.py --write

lint: $(VENV)/.installed-for-tests
	@echo "==> ruff, pyright, import-linter"
	@$(BIN)/ruff check .
	@$(BIN)/ruff format --check -q .
	@$(BIN)/pyright --pythonpath $(BIN)/python
	@$(BIN)/lint-imports

docs: $(VENV)/.installed-for-tests
	@echo "==> the documentation site: docs/_build/index.html"
	@rm -rf docs/_generated
	@$(BIN)/python -P -m sphinx -W --keep-going -q -b html docs docs/_build

clean:
	rm -rf $(VENV) build demo docs/_build docs/_generated

$(BIN)/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "Bevameter needs Python 3.11 or later, this is " + sys.version.split()[0] + ": give another with PYTHON=...")'
	@echo "==> a virtual environment: $(VENV)"
	@$(PYTHON) -m venv $(VENV)

# Not editable: what is run and tested is the package as pip installs it. A build/ left behind would bring back deleted modules.
$(VENV)/.installed: $(BIN)/python $(CODE) $(ABOUT)
	@echo "==> installing Bevameter and what it needs (minutes, the first time)"
	@$(PIP) install -c requirements.lock setuptools
	@rm -rf build
	@$(PIP) install --no-build-isolation -c requirements.lock .
	@rm -rf build
	@touch $@

$(VENV)/.installed-for-tests: $(BIN)/python $(CODE) $(ABOUT)
	@echo "==> installing Bevameter, what it needs and what its tests need (minutes, the first time)"
	@$(PIP) install -c requirements.lock setuptools
	@rm -rf build
	@$(PIP) install --no-build-isolation -c requirements.lock '.[dev,docs,excel,fleet,geo,onnx,postgres,video,view]'
	@rm -rf build
	@touch $(VENV)/.installed $@
