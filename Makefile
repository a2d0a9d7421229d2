# Every goal first sees to the virtual environment, the locked dependencies, the package and libLLVM, and skips what is
# already there. `make PYTHON=/path/to/python demo` insists on one interpreter.

VENV := .venv
OUT := out
PYTHON ?=
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check -qq --no-input
# Names the libLLVM to load where Dr.Jit would not find it by itself; see scripts/ensure_llvm.py.
WITH_LLVM := . ./$(VENV)/llvm.env &&

CREATED := $(VENV)/.created
DEPENDENCIES := $(VENV)/.dependencies
PACKAGE := $(VENV)/.package
LLVM := $(VENV)/llvm.env

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.PHONY: help setup browser demo car test test-slow test-all mutants lint bench fuzz notebooks docs lock clean

help: ## list these goals
	@sed -n 's/^\([a-z-]*\):.*## \(.*\)/  make \1|\2/p' Makefile | awk -F'|' '{printf "%-18s %s\n", $$1, $$2}'

setup: $(LLVM) ## virtual environment, dependencies, package, libLLVM

browser: ## Chromium for the tests of the page, and the packages of tests/publishing/node
	@sh scripts/ensure_browser.sh

demo: setup ## the main job, small: bake, reconstruct, validate; report in out/demo
	@$(WITH_LLVM) $(BIN)/rsibr demo --out $(OUT)/demo

car: setup ## the car of the README: three bakes and a picture, in out/car
	@$(WITH_LLVM) $(BIN)/python scripts/car_picture.py --out $(OUT)/car

test: setup ## the fast tests
	@$(WITH_LLVM) $(BIN)/python -m pytest -m "not slow"

test-slow: setup ## the slow tests alone
	@$(WITH_LLVM) $(BIN)/python -m pytest -m slow

test-all: setup ## every test
	@$(WITH_LLVM) $(BIN)/python -m pytest

mutants: setup ## alter formulas and take out guards, each in a copy, and see that a test notices
	@$(WITH_LLVM) $(BIN)/python scripts/mutants.py

lint: setup ## style, format, types, layers
	@$(BIN)/ruff check --quiet . && echo "ruff check: clean"
	@$(BIN)/ruff format --check .
	@$(BIN)/mypy
	@$(BIN)/lint-imports

# The option stands in pyproject.toml's addopts, and pytest-benchmark refuses it together with --benchmark-only.
bench: setup ## the benchmarks
	@$(WITH_LLVM) $(BIN)/python -m pytest -o addopts="-ra --strict-markers --strict-config" tests/benchmarks --benchmark-only --capture=no

fuzz: setup ## feed 10 000 altered inputs to everything that reads; report in out/fuzz.json
	@$(WITH_LLVM) $(BIN)/python scripts/fuzz.py --inputs 10000 --seed 0 --out $(OUT)/fuzz.json

notebooks: setup ## execute the notebooks into out/notebooks
	@mkdir -p $(OUT)/notebooks
	@$(WITH_LLVM) $(BIN)/jupyter-execute --output="../$(OUT)/notebooks/{notebook_name}" notebooks/*.ipynb
	@echo "notebooks: executed into $(OUT)/notebooks"

docs: setup ## build the documentation site into out/docs; warnings are errors
	@$(WITH_LLVM) $(BIN)/sphinx-build --builder html --jobs auto --quiet --fail-on-warning --keep-going docs $(OUT)/docs
	@echo "docs: open $(OUT)/docs/index.html"

lock: $(CREATED) ## resolve the dependencies anew into requirements.lock
	@$(PIP) install uv
	@sed -n '/^#/p' requirements.lock > $(VENV)/lock
	@$(BIN)/uv pip compile --quiet --universal --all-extras --python-version 3.11 --upgrade --no-header --no-annotate \
		--no-emit-index-url --no-emit-find-links pyproject.toml >> $(VENV)/lock
	@mv $(VENV)/lock requirements.lock

clean: ## remove the virtual environment, the outputs and every cache
	@rm -rf $(VENV) $(OUT) build dist .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache .benchmarks
	@find . -name __pycache__ -type d -prune -exec rm -rf {} +

$(CREATED): scripts/create_venv.sh
	@sh scripts/create_venv.sh $(VENV) $(PYTHON)
	@touch $@

$(DEPENDENCIES): requirements.lock $(CREATED)
	@echo "dependencies: installing requirements.lock"
	@$(PIP) install -r requirements.lock
	@touch $@

$(PACKAGE): pyproject.toml $(DEPENDENCIES)
	@echo "package: installing rsibr"
	@$(PIP) install --no-deps --editable .
	@touch $@

$(LLVM): scripts/ensure_llvm.py $(PACKAGE)
	@$(BIN)/python scripts/ensure_llvm.py $@
