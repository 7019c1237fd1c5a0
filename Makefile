# Everything a fresh machine needs beyond Python 3.11+ and make is set up here, in .venv, from the locked list.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/ready
# Modules are compiled once, not by each of the processes that a bench is made of.
export PYTHONDONTWRITEBYTECODE :=

.PHONY: demo page test test-long test-page test-documents test-campaigns test-extras test-one-extra campaigns types contracts check metrics docs package wheels mutants mutants-sample lock clean

demo: $(READY)
	$(BIN)/rig demo --out demo

# Built once for its sources; .venv/ready has done it where nothing has changed since.
page: $(READY)
	$(BIN)/python hatch_build.py

# What a change breaks in most cases; what takes long is in the five targets below, what rarely breaks in `campaigns`.
# Tests that start processes first and by themselves: beside others that compute, a simulated device came too late.
# The groups of those that take longest come first, whatever their number of tests. The others wait for a third of their
# time, for processes that start and connections that end: a third worker uses it.
MAIN := not campaign and not documents and not extra and not by_hand
test: $(READY) page browser postgresql mbpoll
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(MAKE) --no-print-directory --jobs 2 types contracts
	$(BIN)/pytest -n 2 --dist loadgroup --no-loadscope-reorder -m "bench and not long and $(MAIN)" --ignore tests/page --durations 15
	$(BIN)/pytest -n 3 --dist loadfile -m "not bench and not long and $(MAIN)" --ignore tests/page --durations 10

# CI gives a SEED to what takes longest: a quarter of the tests, another with each commit.
DRAWN := $(if $(SEED),--draw $(SEED))

# More of the same kind, seconds each.
test-long: $(READY) page browser postgresql mbpoll
	$(BIN)/pytest -n 2 --dist loadgroup --no-loadscope-reorder -m "bench and long and $(MAIN)" --ignore tests/page $(DRAWN) --durations 10
	$(BIN)/pytest -n 3 --dist loadfile -m "not bench and long and $(MAIN)" --ignore tests/page $(DRAWN) --durations 10

types: $(READY)
	$(BIN)/mypy

contracts: $(READY)
	$(BIN)/lint-imports --no-logo >$(VENV)/contracts || { cat $(VENV)/contracts; exit 1; }

# The page in a real browser over the service and the mock bench, and before it by itself: beside other browsers at work the
# simulated devices came too late.
PAGE ?= tests/page
test-page: $(READY) page browser
	$(BIN)/pytest -n 2 --dist loadfile $(PAGE) -m "not bench" --durations 5
	$(BIN)/pytest $(PAGE) -m "bench and not by_hand" $(DRAWN) --durations 10

# Every command, cell and example of README and docs, as somebody would run it.
test-documents: $(READY) page
	$(BIN)/pytest -n 2 --dist worksteal -m "documents and not by_hand" tests/test_docs.py tests/system/test_api_docs.py --durations 5

# Diagnoses of many sessions, made and measured, and safety checks that are switched off one by one.
test-campaigns: $(READY)
	$(BIN)/pytest -n 2 --dist loadgroup --no-loadscope-reorder -m "campaign and not by_hand" --ignore tests/page $(DRAWN) --durations 10

# The demonstration, stops and crashes in contact, every answer of the service while the tip presses, further products; one after
# another: beside a second bench a slow computer's devices come too late.
test-extras: $(READY) page nginx
	$(BIN)/pytest -m "extra and not by_hand" --ignore tests/page $(DRAWN) --durations 10
	$(MAKE) --no-print-directory test-one-extra

# By hand, for hours, on a quiet computer, dated in docs/validation: what takes long and rarely breaks, a hundred new examples of
# each property, and the benchmarks that judge; what CI draws from, whole. The first that fails ends it.
campaigns: $(READY) page
	$(MAKE) --no-print-directory test-long test-campaigns test-extras test-page
	$(BIN)/pytest -n 2 --dist loadgroup --no-loadscope-reorder -m by_hand --ignore tests/page --durations 10
	$(BIN)/pytest -m by_hand tests/page
	$(BIN)/pytest -n 2 --dist loadfile -m "hypothesis and $(MAIN)" --ignore tests/page --hypothesis-profile default
	$(BIN)/python -m benchmarks.faults --trials 1
	$(BIN)/python -m benchmarks.faults --plant all --trials 1
	$(BIN)/python -m benchmarks.mutation
	for campaign in forms hidden planted nothing calibration; do $(BIN)/python -m benchmarks.criticism --campaign $$campaign || exit; done
	$(BIN)/python -m benchmarks.control
	$(BIN)/python -m benchmarks.clock
	$(BIN)/python -m benchmarks.contact
	$(BIN)/python -m benchmarks.contact --others
	$(BIN)/python -m benchmarks.preload
	$(BIN)/python -m benchmarks.imported
	for kind in csv parquet h5; do $(BIN)/python -m benchmarks.large_import --kind $$kind || exit; done
	$(BIN)/python -m benchmarks.stop
	$(BIN)/python -m benchmarks.fuzz --each 1000000
	$(BIN)/python -m benchmarks.stalls
	$(BIN)/python -m benchmarks.service --minutes 10
	$(BIN)/python -m benchmarks.page
	$(BIN)/python -m benchmarks.octoprint
	$(BIN)/python -m benchmarks.all

# Each extra in an environment of its own, without the others.
test-one-extra: $(READY)
	$(BIN)/python -m tools.one_extra

# What to run before each commit, in less than half a minute: all checks, and the tests of what changed.
check: $(READY)
	$(BIN)/ruff check --quiet .
	$(BIN)/ruff format --quiet --check .
	$(BIN)/mypy
	$(BIN)/lint-imports --no-logo >$(VENV)/contracts || { cat $(VENV)/contracts; exit 1; }
	$(BIN)/python -m tools.changed_tests

# How the source is built, each number beside its goal; the last line is JSON.
metrics: $(READY)
	@$(BIN)/python -m tools.metrics

docs: $(READY)
	$(BIN)/python -m sphinx -b html -W --keep-going -q -d $(VENV)/doctrees docs docs/_build
	$(BIN)/python -m tools.offline docs/_build

# Wheel and source distribution are installed where there is no checkout, and the demonstration runs from there.
package: $(READY) page
	rm -rf dist
	$(BIN)/uv build --quiet --python $(BIN)/python --no-build-isolation --out-dir dist
	$(BIN)/python -m tools.packaged dist

# All that is locked comes as wheels, for each Python and machine with the C library of Debian 12 or newer; what tests use or extras bring is
# in four cases published as source, without anything to compile that is needed.
PYTHONS := 3.11 3.12 3.13
PLATFORMS := x86_64-manylinux_2_36 aarch64-manylinux_2_36
AS_SOURCE := scikit-surgerycore scikit-surgerynditracker crcmod pyigtl
wheels: $(READY)
	@set -e; for python in $(PYTHONS); do for platform in $(PLATFORMS); do \
	  $(BIN)/uv pip install --quiet --dry-run --require-hashes --target $(VENV)/none --python-version $$python \
	    --python-platform $$platform --only-binary :all: $(AS_SOURCE:%=--no-binary %) -r requirements.lock; \
	  echo "Python $$python on $$platform: the lock resolves to wheels"; done; done

# Mutants of what keeps the tip from hurting; a sample of them, drawn by SEED, in every run of CI.
mutants: $(READY)
	$(BIN)/python -m benchmarks.mutation

mutants-sample: $(READY)
	$(BIN)/python -m benchmarks.mutation --sample 60 $(if $(SEED),--seed $(SEED))

# A mirror that does not answer must not hold up the tests.
APT := DEBIAN_FRONTEND=noninteractive timeout 300 apt-get -o Acquire::Retries=1 -o Acquire::http::Timeout=20

.PHONY: browser
browser:
	@command -v chromium >/dev/null || command -v chromium-browser >/dev/null || command -v google-chrome >/dev/null || { [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null \
	  && $(APT) update -qq && $(APT) install -y -qq --no-install-recommends chromium >/dev/null; } \
	  || echo "no Chromium here and no right to install it: the browser tests will skip"

# Debian keeps the server's own programs out of the path.
.PHONY: postgresql
postgresql:
	@ls /usr/lib/postgresql/*/bin/initdb >/dev/null 2>&1 || command -v initdb >/dev/null || { [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null \
	  && $(APT) update -qq && $(APT) install -y -qq --no-install-recommends postgresql >/dev/null; } \
	  || echo "no PostgreSQL here and no right to install it: its tests will skip"

# A client of Modbus that nobody here wrote.
.PHONY: mbpoll
mbpoll:
	@command -v mbpoll >/dev/null || { [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null \
	  && $(APT) update -qq && $(APT) install -y -qq --no-install-recommends mbpoll >/dev/null; } \
	  || echo "no mbpoll here and no right to install it: its tests will skip"

# The reverse proxy whose file the deployment guide gives. Unpacked only: Debian's package, installed, would serve at once.
.PHONY: nginx
nginx: $(READY)
	@command -v nginx >/dev/null || [ -x $(BIN)/nginx ] || { [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null \
	  && $(APT) update -qq && cd $(VENV) && $(APT) download -qq nginx && dpkg-deb -x nginx_*.deb nginx && ln -sf ../nginx/usr/sbin/nginx bin/nginx; } \
	  || echo "no nginx here and no right to fetch it: its tests will skip"

# Debian's venv has no pip of its own, and a plain Debian no pip at all; uv then installs in seconds what pip takes a
# minute for.
$(READY): requirements.lock pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "Python 3.11 or newer is needed, $(PYTHON) is " + sys.version)'
	$(PYTHON) -m venv --without-pip $(VENV)
	pip=$$($(PYTHON) .ci/pip_wheel.py $(VENV)) \
	  && $(PYTHON) $$pip --python $(BIN)/python install --quiet --disable-pip-version-check uv
	$(BIN)/uv pip install --quiet --python $(BIN)/python --require-hashes -r requirements.lock
	$(BIN)/uv pip install --quiet --python $(BIN)/python --no-deps --no-build-isolation --editable .
	touch $@

lock:
	$(BIN)/uv pip compile --quiet --universal --generate-hashes --no-annotate --no-header --extra dev --extra docs pyproject.toml -o requirements.lock

clean:
	rm -rf $(VENV) demo dist docs/_build api/page/built api/page/sources/node_modules
