# Everything a fresh machine needs beyond Python 3.11+ and make is set up here, in .venv, from the locked list.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/ready
# Modules are compiled once, not by each of the processes that a bench is made of.
export PYTHONDONTWRITEBYTECODE :=

.PHONY: demo test docs mutants mutants-sample lock clean

demo: $(READY)
	$(BIN)/rig demo --out demo

test: $(READY) browser
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/pytest -n 2 --dist loadgroup --durations 25

docs: $(READY)
	$(BIN)/python -m sphinx -b html -W --keep-going -q -d $(VENV)/doctrees docs docs/_build
	$(BIN)/python -m tools.offline docs/_build

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
	rm -rf $(VENV) demo dist docs/_build
