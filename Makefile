# The two commands: `make demo` flies and lands in the simulator, `make test` runs every check.
# `make docs` builds the documentation site into out/site.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
PROGRAM := $(VENV)/.program
TOOLS := $(VENV)/.installed
INSTALL := $(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt

# The workers of the tests, and the programs that these start, share what Python has compiled.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: demo test setup checks kernels lint types docs unit bench pages coverage mutation campaign soak fuzz evidence audit constraints fresh clean

demo: $(PROGRAM)
	$(BIN)/slz demo --headless --out out/demo

# Kernels are compiled once beside the checks of the text, instead of by every worker of the tests.
test: setup
	$(MAKE) -j2 checks kernels
	$(MAKE) unit

checks: lint types docs

# Those of the simulator are compiled by a short flight, and the assertions of the tests by collecting these.
kernels: setup
	$(BIN)/python -c 'from companion.runtime.kernel_compilation import everything; everything()'
	$(BIN)/python -m sitl --scene power_line --intruder walker@10 --mavlink udpout:127.0.0.1:9 --lidar-to 127.0.0.1:9 \
	    --speedup 0 --pilot takeoff --takeoff-alt 5 --duration 12 > /dev/null
	-$(BIN)/python -m pytest --collect-only --quiet > /dev/null

# The whole environment; `make demo` installs the program alone.
setup: $(TOOLS)

$(PROGRAM): pyproject.toml constraints.txt
	@command -v $(PYTHON) > /dev/null || { echo "there is no $(PYTHON): sudo apt install python3-venv, or run 'make PYTHON=/path/to/python3.11'"; exit 2; }
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { echo "Python 3.11 or newer is needed: run 'make PYTHON=/path/to/python3.11'"; exit 2; }
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null || { echo "$(PYTHON) cannot make a virtual environment: install its venv module (Debian: sudo apt install $(notdir $(PYTHON))-venv)"; exit 2; }
	$(PYTHON) -m venv $(VENV)
	$(INSTALL) --editable '.[all]' || { echo "the packages could not be installed (see above): is there a network, a proxy, space here and in $${TMPDIR:-/tmp}? Then run it again"; exit 1; }
	@touch $@

$(TOOLS): $(PROGRAM)
	$(INSTALL) --editable '.[dev,docs]'
	@# Alone, for what they bring along is large or pins what ours does not go with; we use their core only.
	$(INSTALL) --no-deps MAVProxy ouster-sdk
	@touch $@

lint: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/lint-imports --no-cache

types: setup
	$(BIN)/mypy

# Strictly: a broken link, a page that nobody reaches and anything loaded from another host fail.
docs: setup
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet

# By files, the long flights first: what they share is made once, and no long one is left for the end. Three
# workers on two cores: tests that talk to real processes mostly wait.
unit: setup
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -n 3 --dist loadfile --no-loadscope-reorder -m "not bench and not browser"

# Inputs in all harnesses together; what fails is kept in out/fuzz (docs/fuzzing.md).
INPUTS ?= 1000000
fuzz: setup
	$(BIN)/python -m tests.fuzz.campaign --inputs $(INPUTS)

# Known vulnerabilities of what constraints.txt pins; without an answer it says that it did not run.
audit: setup
	@$(INSTALL) --editable '.[audit]' 2>/dev/null \
	    || echo 'dependency audit: pip-audit cannot be installed'
	@$(BIN)/python -m tests.audit

# Can all that constraints.txt pins be had for every Python and machine we name, and is nothing unpinned?
constraints: setup
	@$(INSTALL) --upgrade pip
	$(BIN)/python -m tests.constraints

# Both commands of the README on new Debian systems, in folders; needs root, debootstrap and some gigabytes.
RELEASES ?= bookworm trixie
fresh:
	tests/fresh.sh $(RELEASES)

# All speeds in one table, docs/benchmark/speed.md; five minutes. The loads against C++ need files of ours or yours:
# BASELINE=baseline.cpp GENERATOR=gen.py (docs/benchmark/index.md).
bench: setup
	$(BIN)/python -m tests.bench.speed $(if $(BASELINE),--baseline $(BASELINE)) $(if $(GENERATOR),--generator $(GENERATOR))

# Which pages of docs/benchmark are older than the code they measure; RUN=all makes those again, RUN="wires specks" some.
pages: setup
	$(BIN)/python -m tests.bench.pages $(if $(RUN),--run $(filter-out all,$(RUN)))

# Branches of slz and companion, those of kernels with the compiler off; report in out/coverage (docs/testing.md).
coverage: setup
	$(BIN)/python -m tests.coverage

# Small changes of slz, drawn by SEED, before the tests that reach them; needs what `make coverage` left. Resumable.
mutation: setup
	$(INSTALL) --editable '.[mutation]'
	NUMBA_DISABLE_JIT=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m tests.mutation --seed $(or $(SEED),1) --count $(or $(COUNT),200)

# Faults in every state of the landing; goes on where it was stopped. FLIGHTS=285 flies each once.
campaign: setup
	$(BIN)/python -m tests.campaign --flights $(or $(FLIGHTS),2000)

# A day on the simulated clock; CLOCK=real for two hours of real time at full rate (docs/soak.md).
soak: setup
	$(BIN)/python -m tests.soak $(or $(CLOCK),simulated)

# Safety case of a short set of runs, in out/evidence; failures do not end it, for the page shows them. Results of
# longer runs: ARTEFACTS="--artefact FILE ..." (docs/evidence.md).
EVIDENCE := out/evidence
evidence: setup
	-OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -n 3 --dist loadfile --no-loadscope-reorder -m "not bench and not browser" \
	    --junitxml $(EVIDENCE)/junit.xml
	-$(BIN)/python -m tests.campaign $(if $(FLIGHTS),--flights $(FLIGHTS)) --out $(EVIDENCE)/campaign
	-$(BIN)/python -m tests.fuzz.campaign --inputs 100000 --out $(EVIDENCE)/fuzz.json
	$(BIN)/slz evidence --out $(EVIDENCE) --artefact $(EVIDENCE)/junit.xml --artefact $(EVIDENCE)/campaign/flights.jsonl \
	    --artefact $(EVIDENCE)/fuzz.json $(ARTEFACTS)

clean:
	rm -rf $(VENV) build dist out *.egg-info
