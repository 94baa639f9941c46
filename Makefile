# The two commands: `make demo` flies and lands in the simulator, `make test` checks all that protects a user.
# `make docs` builds the documentation site into out/site.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
PROGRAM := $(VENV)/.program
TOOLS := $(VENV)/.installed
INSTALL := $(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt

# The workers of the tests, and the programs that these start, share what Python has compiled.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: demo quick touched test test-all setup checks kernels lint types docs unit bench pages coverage mutation campaign soak fuzz evidence audit constraints fresh clean

demo: $(PROGRAM)
	$(BIN)/slz demo --headless --out out/demo

# After an edit: kernels against slow plain code, the rules of the landing, parameters, what is on the wire.
PYTEST := OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -q
RULES := test_check_order.py test_mavlink_orders.py interruptions/test_preconditions.py
QUICK := tests/oracle tests/unit/params tests/unit/companion/flight/link/wire \
    $(addprefix tests/unit/companion/flight/landing/,$(RULES))
quick: setup
	$(PYTEST) -n 2 -m "not long and not bench" $(QUICK)

# What reaches one file: FILE=slz/zones/ranking.py.
touched: setup
	@test -n "$(FILE)" || { echo "which file? make touched FILE=slz/zones/ranking.py"; exit 2; }
	$(PYTEST) -m "not bench and not browser" $$($(BIN)/python -m tests.reach $(FILE))

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
WORKERS := -n 3 --dist loadfile --no-loadscope-reorder
unit: setup
	$(PYTEST) $(WORKERS) -m "$(if $(ALL),,not long and )not bench and not browser"

# What `make test` leaves out: most flights, searches, long recordings and surveys.
test-all: setup
	$(PYTEST) $(WORKERS) -m "long and not bench and not browser"

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

# Branches of slz and companion; pages in out/coverage/html (docs/testing.md). The kernels are measured with the compiler
# off; what takes too long for Python alone ends by its time limit, and whether it passes is the compiled run's matter.
UNCOMPILED := tests/oracle tests/property tests/unit/slz tests/unit/companion/flight/sensors tests/unit/companion/flight/fusion \
    tests/unit/companion/desk/survey tests/unit/companion/desk/clouds
coverage: setup
	rm -rf out/coverage
	-NUMBA_DISABLE_JIT=1 $(BIN)/coverage run -m pytest -q -n 3 --timeout 3 -W ignore::RuntimeWarning -m "not bench" $(UNCOMPILED)
	$(BIN)/coverage run -m pytest -q -n 3 --dist loadfile --timeout 0 -m "not bench and not browser"
	$(BIN)/coverage combine --quiet
	$(BIN)/coverage html --quiet
	$(BIN)/coverage report

# All small changes of one file, each before the tests that reach it: FILE=slz/zones/ranking.py.
mutation: setup
	$(INSTALL) --editable '.[mutation]'
	mkdir -p out/mutation
	sed 's#FILE#$(FILE)#; s#TESTS#$(shell $(BIN)/python -m tests.reach $(FILE))#' tests/mutation.toml > out/mutation/session.toml
	$(BIN)/cosmic-ray init --force out/mutation/session.toml out/mutation/session.sqlite
	$(BIN)/cosmic-ray exec out/mutation/session.toml out/mutation/session.sqlite
	$(BIN)/cr-report out/mutation/session.sqlite

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
	-$(PYTEST) $(WORKERS) -m "not bench and not browser" \
	    --junitxml $(EVIDENCE)/junit.xml
	-$(BIN)/python -m tests.campaign $(if $(FLIGHTS),--flights $(FLIGHTS)) --out $(EVIDENCE)/campaign
	-$(BIN)/python -m tests.fuzz.campaign --inputs 100000 --out $(EVIDENCE)/fuzz.json
	$(BIN)/slz evidence --out $(EVIDENCE) --artefact $(EVIDENCE)/junit.xml --artefact $(EVIDENCE)/campaign/flights.jsonl \
	    --artefact $(EVIDENCE)/fuzz.json $(ARTEFACTS)

clean:
	rm -rf $(VENV) build dist out *.egg-info
