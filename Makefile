# `make demo` and `make test` need Python 3.11 or later and make, and nothing else.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
INSTALL := $(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt

.PHONY: demo test check bench samples pictures clean

demo: $(VENV)/installed  ## set up, then identify the sample: the main job
	$(BIN)/identify sample_data/flexible.mp4 --tag-size 30 --mass 225 --move sample_data/move.toml

test: $(VENV)/installed-for-tests  ## set up, then everything that CI checks
	$(MAKE) check

check:  ## format, lint, types, imports, tests
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/pytest --numprocesses auto --dist worksteal

bench: $(VENV)/installed-for-tests  ## every benchmark: each prints its ratios
	for benchmark in benchmarks/*.py; do $(BIN)/python $$benchmark || exit 1; done

samples: $(VENV)/installed  ## make the sample videos again from their scenes
	for scene in flexible stiff released bag; do $(BIN)/identify render sample_data/$$scene.toml || exit 1; done

pictures: $(VENV)/installed  ## the pictures of README and docs, made by the program itself
	$(BIN)/identify sample_data/flexible.mp4 --tag-size 30 --mass 225 --move sample_data/move.toml --quiet
	cp $(addprefix flexible-identify/figures/,decay.png pendulum.png residual.png trajectory.png) docs/pictures/
	$(BIN)/identify design --from flexible-identify/result.json --move sample_data/move.toml --frequency-spread 3 \
		--max-pcp-acceleration 20 --box 15 --out flexible-identify/design
	cp flexible-identify/design/design.png docs/pictures/
	$(BIN)/python docs/draw_figures.py docs/pictures

clean:
	rm -rf $(VENV) build *-identify

$(VENV)/bin/python:
	$(PYTHON) -m venv $(VENV)

$(VENV)/installed: $(VENV)/bin/python pyproject.toml constraints.txt
	$(INSTALL) --editable .
	touch $@

$(VENV)/installed-for-tests: $(VENV)/bin/python pyproject.toml constraints.txt
	$(INSTALL) --editable '.[test,cluster]'
	touch $@ $(VENV)/installed
