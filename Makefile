# rivid: `make run` does the main job on the sample year, `make test` proves the rest. Both set up first.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
OUT ?= out
export OPENBLAS_NUM_THREADS = 1
unexport PYTHONDONTWRITEBYTECODE  # without its bytecode the package is compiled anew by each process

.DEFAULT_GOAL := help
.PHONY: help install setup run week glen-canyon exam exam-quick exam-mutations diagnose-real real hydraulic-page test test-long check bench scale accuracy posterior-pages peers consumers forecast-page glen-canyon-page figures paper-page sensitivity pictures sample-data docs lock clean

help:  ## list the targets
	@sed -n 's/^\([a-z-]*\):.*## /\1\t/p' $(MAKEFILE_LIST) | expand -t 18

$(VENV)/.ready: pyproject.toml requirements.lock
	$(PYTHON) -c "import sys; assert sys.version_info >= (3, 11), 'rivid needs Python 3.11 or newer'"
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -r requirements.lock
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --editable .
	@touch $@

$(VENV)/.dev: $(VENV)/.ready requirements-dev.lock
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -r requirements-dev.lock
	@touch $@

install: $(VENV)/.ready  ## what a run needs, with locked versions, in .venv

setup: $(VENV)/.dev  ## the same with tests, types and Dask

run: install  ## the main job: estimate the sample year and write its report
	$(BIN)/rivid run sample_data/basse_isere --config configs/basse_isere.toml --out $(OUT)/basse_isere

week: install  ## the same for a week of CSV files
	$(BIN)/rivid run sample_data/basse_isere_csv --config configs/basse_isere.toml --out $(OUT)/basse_isere_csv

glen-canyon: install  ## the measured river: Lees Ferry to mile 30, and dam to Lees Ferry
	$(BIN)/rivid run sample_data/glen_canyon --config configs/glen_canyon_rm30.toml --out $(OUT)/glen_canyon_rm30
	$(BIN)/rivid run sample_data/glen_canyon --config configs/glen_canyon.toml --out $(OUT)/glen_canyon

KERNELS := $(shell grep -rl "^@njit" --include=*.py rivid)
$(VENV)/.compiled: $(VENV)/.dev $(KERNELS)  # these tests call all kernels: compiled here once, not by each worker
	$(BIN)/python -m pytest -n 2 --dist loadfile -m "not long" \
		tests/reach/test_gate.py tests/diagnosis/test_noise.py tests/diagnosis/test_response.py \
		tests/diagnosis/test_decision.py::test_events_pay_for_those_of_the_impossible_sign
	@touch $@

test: setup $(VENV)/.compiled  ## all tests but the long loops
	$(BIN)/python -m pytest -n auto --dist worksteal -m "not long"

test-long: setup $(VENV)/.compiled  ## the long loops and the tests of the benchmarks too
	RIVID_LONG=1 $(BIN)/python -m pytest -n auto tests rivid benchmarks/tests

check: setup  ## ruff, mypy strict, and the layers
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/python -m pytest -q tests/test_layers.py

bench: setup  ## speed and memory, written to docs/performance.md
	$(BIN)/python -m benchmarks.performance

scale: setup  ## 100,000 and 1,000,000 days of a fleet, written to docs/scale.md (half an hour, 10 GB of TMPDIR)
	$(BIN)/python -m benchmarks.scale

accuracy: setup  ## accuracy beside its baselines, written to docs/accuracy.md
	$(BIN)/python -m benchmarks.accuracy

posterior-pages: setup  ## accuracy and calibration of `posterior`, written to docs/accuracy_{posterior,river}.md
	$(BIN)/python -m benchmarks.posterior
	$(BIN)/python -m benchmarks.posterior_river

PEERS := .venv-peers
$(PEERS)/.ready: pyproject.toml requirements.lock  # sysidentpy asks for an older numpy than the lock holds
	$(PYTHON) -m venv $(PEERS)
	$(PEERS)/bin/python -m pip install --quiet --disable-pip-version-check --editable ".[bench]"
	@touch $@

CONSUMERS := .venv-consumers
consumers:  ## the files of `rivid export`, read by their target software in an environment of its own
	$(PYTHON) -m venv $(CONSUMERS)
	$(CONSUMERS)/bin/python -m pip install --quiet --disable-pip-version-check --editable ".[consumers]"
	$(CONSUMERS)/bin/python -m pytest -q -p no:cacheprovider tests/test_export.py

peers: $(PEERS)/.ready  ## `posterior` compared with alternative methods, written to docs/peers.md
	$(PEERS)/bin/python -m benchmarks.peers

forecast-page: $(PEERS)/.ready  ## forecasts beside their peers, written to docs/forecast.md
	$(PEERS)/bin/python -m benchmarks.forecast

glen-canyon-page: setup  ## the measured river beside what is known of it, written to docs/glen_canyon.md
	$(BIN)/python -m benchmarks.glen_canyon

hydraulic-page: setup  ## travel times and Table VI on the hydraulic truth, written to docs/hydraulic.md
	$(BIN)/python -m benchmarks.hydraulic

exam: setup  ## 1500 simulated seasons, each in its own world, written to docs/exam.md; goes on where it was stopped
	$(BIN)/python -m benchmarks.exam

exam-quick: setup  ## a few dozen short seasons, in minutes; fails where a share is far from its target
	$(BIN)/python -m benchmarks.exam quick

exam-mutations: setup  ## parts of the diagnosis taken out one by one: the exam must fail each time
	$(BIN)/python -m benchmarks.exam.mutations

real: setup  ## travel times and diagnoses of all measured data, written to docs/real.md
	$(BIN)/python -m benchmarks.real

diagnose-real: setup  ## the hidden bypass of Glen Canyon Dam, written to docs/diagnose_real.md
	$(BIN)/python -m benchmarks.diagnose_real

figures: run  ## the paper's figures of the sample year, and the cascade's, on one page
	$(BIN)/rivid figures $(OUT)/basse_isere --paper

paper-page: setup  ## the paper's claims compared with the results here, written to docs/paper.md
	$(BIN)/python -m benchmarks.paper

sensitivity: setup  ## sensitivity of the estimate, written to docs/sensitivity.md
	$(BIN)/python -m benchmarks.sensitivity

pictures: run glen-canyon  ## the pictures of the README and the guide (the page's needs Chromium)
	mkdir -p docs/pictures
	cp $(OUT)/basse_isere/figures/tdr_jmap.png docs/pictures/tdr_jmap.png
	cp $(OUT)/glen_canyon_rm30/figures/t50_discharge_map.png docs/pictures/glen_canyon_t50.png
	$(BIN)/python -m benchmarks.page_pictures $(OUT)/basse_isere --keep docs/pictures/report.png
	$(BIN)/python -m benchmarks.guide_pictures

sample-data: setup  ## make the simulated sample data again, the same bytes
	PYTHONPATH=. $(BIN)/python sample_data/make.py

$(VENV)/.docs-ready: $(VENV)/.dev docs/requirements.txt
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -r docs/requirements.txt
	@touch $@

docs: $(VENV)/.docs-ready  ## the documentation site in build/docs, its examples run, its links checked
	rm -rf build/docs
	$(BIN)/python -m sphinx -W --keep-going -n -E -q -b html -d build/doctrees docs build/docs
	$(BIN)/python docs/_ext/links.py build/docs
	@echo "site: build/docs/index.html"

lock: setup  ## resolve the locked versions anew (needs uv)
	uv pip compile --universal pyproject.toml -o requirements.lock --no-annotate --no-header
	uv pip compile --universal --extra dev pyproject.toml -c requirements.lock -o requirements-dev.lock --no-annotate --no-header
	uv pip compile --universal --extra docs pyproject.toml -c requirements.lock -o docs/requirements.txt --no-annotate --no-header

clean:  ## remove the environment and all output
	rm -rf $(VENV) $(PEERS) $(CONSUMERS) out build dist *.egg-info .mypy_cache .ruff_cache .pytest_cache
