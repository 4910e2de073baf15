# flownav: `make demo` flies the whole mission, from the pad and back onto it, `make test` proves the package. Either works first.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
unexport PYTHONDONTWRITEBYTECODE  # the tests start Python hundreds of times: what it made of NumPy and Numba is kept
INSTALL := $(BIN)/python -m pip install --quiet --no-compile --disable-pip-version-check --constraint constraints.txt

.PHONY: demo test test-real-time test-random test-gpu test-slow long-log fuzz mutants league made-flights explain envelope integrity witnesses rare validate weigh onboard figures digests pairs report-size install-size schemas lint bench bench-once docs pictures tutorials wheel wheel-test clean

demo: $(VENV)/.ready
	$(BIN)/flownav fly --out out/sortie.fnr --force

test: $(VENV)/.ready-test
	PYTHONHASHSEED=0 $(BIN)/python -m pytest -m "not slow and not real_time" -n 2 --dist loadfile --no-loadscope-reorder -p no:benchmark --durations=25 --durations-min=5

test-real-time: $(VENV)/.ready-test
	$(BIN)/python -m pytest -m real_time -p no:benchmark

test-random: $(VENV)/.ready-test
	$(BIN)/python -m pytest -m "hypothesis and not slow" --hypothesis-profile=random -p no:benchmark

test-gpu: $(VENV)/.ready-test $(VENV)/.ready-gpu
	$(BIN)/python -m pytest -p no:benchmark tests/campaigns/test_cuda_compiled.py

test-slow: $(VENV)/.ready-test
	$(BIN)/python -m pytest -m slow

long-log: $(VENV)/.ready-test
	$(BIN)/python -m pytest -s -m slow tests/replays/test_long_log.py

fuzz: $(VENV)/.ready-test
	FLOWNAV_FUZZ=$${FLOWNAV_FUZZ:-20000} $(BIN)/python -m pytest -m fuzz tests/logs tests/live/test_fuzz_live.py tests/core/test_fuzz_parameters.py tests/campaigns/test_fuzz_files.py

mutants: $(VENV)/.ready-test
	$(BIN)/python tests/helpers/mutants.py $(if $(EVERY),--every $(EVERY)) $(PART)

league: $(VENV)/.ready
	$(BIN)/python tools/league.py $${FLOWNAV_DATA:-../shared/data} docs/explanation/league.md
	$(MAKE) made-flights

made-flights: $(VENV)/.ready
	$(BIN)/python tools/made_flights.py judge --signs --page docs/explanation/made-flights.md
	$(BIN)/python tools/made_flights.py compare $${FLOWNAV_DATA:-../shared/data} --seeds 5 --page docs/explanation/made-flights.md

explain: $(VENV)/.ready
	$(BIN)/python tools/explain.py docs/explanation/explained.md --data $${FLOWNAV_DATA:-../shared/data} $(if $(CALIBRATE),--calibrate)

envelope: $(VENV)/.ready
	$(BIN)/python tools/envelope.py docs/explanation/control.md

integrity: $(VENV)/.ready
	$(BIN)/python tools/integrity.py docs/explanation/integrity.md
	$(BIN)/python tools/gps_led_off.py docs/explanation/integrity.md

witnesses: $(VENV)/.ready
	$(BIN)/python tools/witnesses.py docs/explanation/faults.md $(if $(SEEDS),--seeds $(SEEDS))

rare: $(VENV)/.ready
	$(BIN)/python tools/rare_table.py $(FLIGHTS)

validate: $(VENV)/.ready
	rm -f out/validation.md
	FLOWNAV_DATA=$${FLOWNAV_DATA:-../shared/data} $(BIN)/flownav validate --out out/validation.md
	mv out/validation.md docs/explanation/validation.md

weigh: $(VENV)/.ready
	$(BIN)/python tools/weigh.py

onboard: $(VENV)/.ready-onboard
	$(BIN)/python tools/onboard.py docs/explanation/onboard.md

figures: $(VENV)/.ready
	$(BIN)/python tools/docs/figures.py $(ONLY)

digests: $(VENV)/.ready
	$(BIN)/python tools/digests.py $(DIGESTS)

pairs: $(VENV)/.ready
	$(BIN)/python tools/pairs.py $(OTHER)

report-size: $(VENV)/.ready-test
	$(BIN)/python tools/report_size.py $(RECORDS)

install-size:
	rm -rf out/installed && $(PYTHON) -m venv out/installed
	out/installed/bin/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt $(or $(WHEEL),.)
	out/installed/bin/python tools/install_size.py out/installed/lib/python3*/site-packages

schemas: $(VENV)/.ready
	$(BIN)/python tools/schemas.py

lint: $(VENV)/.ready-lint
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/python tools/words.py

bench: $(VENV)/.ready-test
	$(BIN)/flownav bench
	$(BIN)/python -m pytest benchmarks --benchmark-disable-gc

bench-once: $(VENV)/.ready-test
	$(BIN)/flownav bench --flights 16
	FLOWNAV_LIVE_BENCH_S=$${FLOWNAV_LIVE_BENCH_S:-8} FLOWNAV_SERIAL_BENCH_S=$${FLOWNAV_SERIAL_BENCH_S:-8} $(BIN)/python -m pytest benchmarks --benchmark-disable

docs: $(VENV)/.ready-docs
	$(BIN)/python tools/docs/build.py

pictures: $(VENV)/.ready-docs
	$(BIN)/python tools/docs/pictures.py

tutorials: $(VENV)/.ready-docs
	$(BIN)/python tools/docs/notebooks.py out/tutorials

wheel: $(VENV)/.ready-wheel
	$(BIN)/python tools/build_wheel.py

wheel-test: $(VENV)/.ready-test wheel
	FLOWNAV_WHEEL=$$(ls dist/flownav-*.whl) $(BIN)/python -m pytest -m slow tests/compiling/test_wheel.py

clean:
	rm -rf $(VENV) build dist out .pytest_cache .mypy_cache .ruff_cache .hypothesis .benchmarks

$(VENV)/.python:
	@$(PYTHON) -c 'import sys; sys.exit("flownav needs Python 3.11 or newer: make PYTHON=python3.x") if sys.version_info < (3, 11) else None'
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --upgrade --constraint constraints.txt pip
	@touch $@

$(VENV)/.ready: $(VENV)/.python pyproject.toml constraints.txt
	@echo "flownav: installing libraries into $(VENV), once, about half a minute"
	$(INSTALL:--quiet=--progress-bar off) --editable '.[compile,plots,pictures]'
	@touch $@

$(VENV)/.ready-%: $(VENV)/.ready
	$(INSTALL) --group $*
	@touch $@
