# Every target makes and reuses .venv by itself.
PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
OUT    := out
# Many tests wait for ports and processes: half as many workers again as cores. Slow ones keep a core busy each, with
# emulated gloves and simulated boards that must keep time.
CORES = $(shell $(PYTHON) -c "import os; print(os.cpu_count())")
WORKERS = $(shell expr $(CORES) \* 3 / 2)

# The scene that `make demo` simulates: a shipped one by its name, or a file. With TABLE=table.csv it imports that. Of the
# crowd, four people: of two, the interval for a new person would say nothing.
SCENE ?= crowd
PEOPLE := $(if $(filter crowd,$(SCENE)),--subjects 4 --repetitions 6)

PACKAGES := cli compiler drivers firmware_templates runtime simulator stability studio
PYTHONS := 3.11 3.12 3.13 3.14

.PHONY: help demo test test-slow test-all pythons mutants lint format types size bench soak fuzz docs dist wheels check clean

help:           ## list the targets
	@grep -E '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed 's/:.*##/\t/' | expand -t 16

$(VENV)/installed: pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade "pip>=25.1"
	$(BIN)/python -m pip install --quiet --editable ".[compiler,stability,ros,lsl,ble,mqtt,osc,web,foxglove]" --group dev
	touch $@

demo: $(VENV)/installed  ## recordings, rates, frontier, build, report, run: SCENE=crowd, or TABLE=examples/home_glove.csv
	mkdir -p $(OUT)
ifdef TABLE
	$(BIN)/thenar import "$(TABLE)" -o $(OUT)/set.grasps --yes --overwrite
else
	$(BIN)/thenar simulate "$(SCENE)" $(PEOPLE) -o $(OUT)/set.grasps --overwrite
	$(BIN)/thenar draw $(OUT)/set.grasps -o $(OUT)/contacts.svg --overwrite
endif
	$(BIN)/thenar place $(OUT)/set.grasps --draw $(OUT)/sensors.svg --overwrite
	$(BIN)/thenar evaluate $(OUT)/set.grasps -o $(OUT)/evaluation.json --overwrite --repeats 1 $(if $(TABLE),--tables compositions)
	$(BIN)/thenar frontier $(OUT)/set.grasps -o $(OUT)/frontier --methods elimination,id3 --rounds 50 --repeats 1 --finalists 4 --budget-us 5000
	$(BIN)/thenar compile $(OUT)/set.grasps -o $(OUT)/build --from $(OUT)/frontier/frontier.json
	$(BIN)/thenar verify $(OUT)/build $(OUT)/set.grasps
	$(BIN)/thenar run $(OUT)/build --replay $(OUT)/set.grasps > $(OUT)/grasps.jsonl
ifndef TABLE
	$(BIN)/thenar compile $(OUT)/set.grasps -o $(OUT)/live --folds 0 --no-report --propose $(OUT)/glove.toml --chip board --overwrite
	$(BIN)/thenar emulate "$(SCENE)" --glove $(OUT)/glove.toml --dir $(OUT)/emulated --period-ms 150 -- \
	    $(BIN)/thenar run $(OUT)/live --glove $(OUT)/emulated/glove.toml --frames 2000 > $(OUT)/live.jsonl
	@echo "Grasps are simulated; live ones, from a glove that was emulated, in $(OUT)/live.jsonl;"
	@echo "which switches close: $(OUT)/contacts.svg."
endif
	@echo "The grasps are in $(OUT)/set.grasps, the build is in $(OUT)/build, one recognised grasp a line in $(OUT)/grasps.jsonl;"
	@echo "what each sensor is worth: $(OUT)/sensors.svg; what accuracy costs in time: $(OUT)/frontier/frontier.svg; the build on one page: $(OUT)/build/report.html; its glove: $(OUT)/build/spec;"
	@echo "the rates: $(OUT)/evaluation.json."

test: $(VENV)/installed  ## the tests, some eight minutes on two idle cores
	$(BIN)/python -m pytest -m "not slow" -n $(WORKERS)

test-slow: $(VENV)/installed pythons  ## the slower checks, some 18 minutes: real Weka, fuzzing, recordings at full length
	$(BIN)/python -m pytest -m slow -n $(CORES) --dist loadfile --no-loadscope-reorder

test-all: test test-slow  ## both

pythons: $(VENV)/installed  ## .venv-3.x with thenar for every other Python of this machine (PATH, pyenv)
	@others=$$($(BIN)/python -m thenar.stability.pythons) && echo "$$others" | while read -r version python; do \
	    test -z "$$version" || $(MAKE) --no-print-directory OTHER="$$python" ".venv-$$version/installed" || exit 1; done

.venv-3.%/installed: pyproject.toml
	$(OTHER) -m venv .venv-3.$*
	.venv-3.$*/bin/python -m pip install --quiet --upgrade "pip>=25.1"
	.venv-3.$*/bin/python -m pip install --quiet --editable ".[compiler,stability]"
	touch $@

lint: $(VENV)/installed  ## ruff: rules and formatting; codespell: spelling, and the words of words.txt
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/codespell *.md *.toml Makefile docs examples benchmarks $(PACKAGES)

size: $(VENV)/installed  ## lines, tokens, classes and docstrings by room
	$(BIN)/python benchmarks/size.py

dist: $(VENV)/installed  ## the sdist and the wheel, in dist/, with their metadata checked
	$(BIN)/python -m build
	$(BIN)/twine check --strict dist/*

# Fails if one has none. Its table is that of docs/how-to/raspberry-pi.md.
wheels: $(VENV)/installed  ## the wheels of the base dependencies for aarch64 (a Raspberry Pi), from the network
	@rm -rf $(OUT)/wheels && mkdir -p $(OUT)/wheels
	@$(BIN)/python -c "import tomllib; print(*tomllib.load(open('pyproject.toml', 'rb'))['project']['dependencies'], sep='\n')" \
	    > $(OUT)/wheels/base.txt
	@printf '| Python | wheels for aarch64 |\n|---|---|\n'
	@for python in $(PYTHONS); do \
	    $(BIN)/python -m pip download --quiet --only-binary=:all: --python-version $$python \
	        --platform manylinux2014_aarch64 --platform manylinux_2_28_aarch64 \
	        --requirement $(OUT)/wheels/base.txt --dest $(OUT)/wheels/$$python || exit 1; \
	    echo "| $$python | $$(ls $(OUT)/wheels/$$python | sed -E 's/^([^-]+)-([^-]+)-.*/\1 \2/' | paste -sd, | sed 's/,/, /g') |"; done

format: $(VENV)/installed  ## let ruff fix what it can
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

types: $(VENV)/installed  ## mypy --strict, and pyright: no import of ours that an editor cannot follow
	$(BIN)/mypy $(foreach package,$(PACKAGES),-p thenar.$(package))
	MYPYPATH=src:benchmarks:tests/fuzz:tests/mutants $(BIN)/mypy --explicit-package-bases tests benchmarks
	$(BIN)/pyright --pythonpath $(BIN)/python

$(VENV)/bench: $(VENV)/installed
	$(BIN)/python -m pip install --quiet --group bench
	touch $@

mutants: $(VENV)/installed  ## 200 small deliberate faults, drawn over all rooms: how many do the quick tests catch?
	rm -rf .mutants
	env -u THENAR_REQUIRE_ALL $(BIN)/python tests/mutants/mutants.py .mutants

bench: $(VENV)/bench  ## the benchmarks, as ratios against a peer or a bound in the same run
	@$(BIN)/python -c "from thenar.compiler.frontier.price import machine_name; print(machine_name())"
	$(BIN)/python benchmarks/id3.py
	$(BIN)/python benchmarks/boosting.py
	$(BIN)/python benchmarks/runtime.py
	$(BIN)/python benchmarks/simulator.py
	$(BIN)/python benchmarks/live.py
	$(BIN)/python benchmarks/web.py
	$(BIN)/python benchmarks/firmware.py

soak: $(VENV)/installed  ## an hour of live recognition on emulated devices: does anything grow?
	$(BIN)/python benchmarks/soak.py

# FUZZ="--minutes 60 --formats npz,mcap"; without, until Ctrl-C.
fuzz: $(VENV)/installed  ## hostile files of every format, guided by coverage, until Ctrl-C: does anything fail?
	$(BIN)/python tests/fuzz/run.py $(FUZZ)

docs: $(VENV)/installed  ## the documentation as a site in site/, offline
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict

check: lint types test  ## what a commit should pass

clean:          ## remove everything that the targets make
	rm -rf $(VENV) .venv-3.* $(OUT) .mutants build dist site *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis .fuzz
