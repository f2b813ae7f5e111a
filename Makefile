# capslip: from a scan of a joint face to its damping.
# `make` lists the targets. A target that needs the environment builds it first.

PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
READY  := $(VENV)/.ready
DOCS_READY := $(VENV)/.docs-ready
OUT    ?=
CONFIG ?=

.DEFAULT_GOAL := help
.PHONY: help setup analyze batch inspect compare reproduce bench chart limits validation soak mutants warnings docs samples test test-long lint format clean

help: ## List the targets
	@awk -F ':.*## ' '/^[a-z-]+:.*## / {printf "  %-11s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

setup: $(READY) ## Build the environment in .venv (every target that needs it does so)

$(READY): pyproject.toml constraints.txt
	@echo "building the environment in $(VENV) (once; about a minute)" >&2
	@test -x $(BIN)/python || $(PYTHON) -P -m venv $(VENV)
	@$(BIN)/python -P -m pip install --quiet --disable-pip-version-check -c constraints.txt -e ".[vendor,fleet,test]"
	@$(BIN)/python -P -m compileall -q pipeline  # pip leaves it to each start, which may not write
	@touch $@

analyze: $(READY) ## Analyse one scan: SURFACE=file [CONFIG=file.toml] [OUT=folder]
	@test -n "$(SURFACE)" || { echo "make analyze: SURFACE=... is missing; for example SURFACE=sample_surfaces/paper_face_a.h5" >&2; exit 2; }
	@$(BIN)/capslip analyze $(if $(CONFIG),--config "$(CONFIG)") $(if $(OUT),--out "$(OUT)") $(ARGS) -- "$(SURFACE)"

batch: $(READY) ## Analyse many scans: SCANS=folder OUT=folder [CONFIG=file.toml]
	@test -n "$(SCANS)" || { echo "make batch: SCANS=... is missing; for example SCANS=sample_surfaces OUT=results/samples" >&2; exit 2; }
	@$(BIN)/capslip batch $(if $(CONFIG),--config "$(CONFIG)") $(if $(OUT),--out "$(OUT)") $(ARGS) -- "$(SCANS)"

inspect: $(READY) ## Look at the fitted caps in PyVista: RESULT=folder
	@test -n "$(RESULT)" || { echo "make inspect: RESULT=... is missing; for example RESULT=results/paper_face_a" >&2; exit 2; }
	@$(BIN)/capslip inspect $(ARGS) -- "$(RESULT)"

compare: $(READY) ## A result against measured damping: RESULT=folder ASSEMBLY=csv [MONOLITHIC=csv] [OUT=folder]
	@test -n "$(RESULT)" -a -n "$(ASSEMBLY)" || { echo "make compare: RESULT=... and ASSEMBLY=... are needed" >&2; exit 2; }
	@$(BIN)/capslip compare --assembly "$(ASSEMBLY)" $(if $(MONOLITHIC),--monolithic "$(MONOLITHIC)") $(if $(OUT),--out "$(OUT)") $(ARGS) -- "$(RESULT)"

reproduce: $(READY) ## The paper's tables, figures and errata: [OUT=folder]
	@$(BIN)/capslip reproduce $(if $(OUT),--out "$(OUT)") $(ARGS)
	@$(BIN)/python -P -m capslip.studies.paper.errata docs/errata.md

bench: $(READY) ## Timings of commands, stages and solvers beside their peers: [OUT=folder]
	@$(BIN)/capslip bench $(if $(OUT),--out "$(OUT)") $(ARGS)

chart: $(READY) ## Speed against accuracy of every method, into docs/: [OUT=folder] [SCANS=folder]
	@OPENBLAS_NUM_THREADS=1 $(BIN)/capslip chart --out "$(or $(OUT),docs)" $(if $(SCANS),--scans "$(SCANS)") $(ARGS)

limits: $(READY) ## Where each method breaks and what the program says, into docs/: [OUT=folder]
	@$(BIN)/capslip limits --out "$(or $(OUT),docs)" $(ARGS)

validation: $(READY) ## The law of a real lap joint beside published backbones: [JOINT=folder]
	@$(BIN)/python -P -m capslip.studies.validation "$(or $(JOINT),../shared/joint)"

soak: $(READY) ## Long checks: random contact scenes, damaged files, a fleet that is killed
	@$(BIN)/python tests/soak.py

mutants: $(READY) ## Break the code in one place at a time and see whether a test fails
	@$(BIN)/python tests/mutants.py $(ARGS)

warnings: $(READY) ## Write docs/warnings.md from the registry of problems
	@$(BIN)/python -P -m capslip.problems > docs/warnings.md

docs: $(DOCS_READY) ## The pages of the site into build/site; every command and example on them runs
	@rm -rf build/site
	@OPENBLAS_NUM_THREADS=1 $(BIN)/python -P -m sphinx -E -W --keep-going -n -q -d build/doctrees docs build/site
	@$(BIN)/python -P tests/check_site.py build/site

$(DOCS_READY): $(READY) pyproject.toml constraints.txt
	@$(BIN)/python -P -m pip install --quiet --disable-pip-version-check -c constraints.txt -e ".[docs]"
	@touch $@

samples: $(READY) ## Write the sample surfaces again
	@$(BIN)/python -P -m capslip.studies.faces.samples sample_surfaces

# Many tests start programs, each of which would compile the package anew
PYTEST = OPENBLAS_NUM_THREADS=1 PYTHONDONTWRITEBYTECODE= $(BIN)/python -P -m pytest --numprocesses=2 --dist=loadfile --no-loadscope-reorder

test: $(READY) ## Run the tests that take no seconds each, some minutes
	@$(PYTEST) -m "not long" $(ARGS)

test-long: $(READY) ## Run the other tests, which take two to three times as long
	@$(PYTEST) -m long $(ARGS)

lint: $(READY) ## Check style and types
	@$(BIN)/ruff check .
	@$(BIN)/ruff format --check .
	@$(BIN)/mypy

format: $(READY) ## Format the code
	@$(BIN)/ruff check --fix .
	@$(BIN)/ruff format .

clean: ## Remove the environment, results and caches
	rm -rf $(VENV) results build docs/api docs/gallery dist *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
