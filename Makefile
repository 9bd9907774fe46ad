# make demo: two boxers spar in the browser.   make test: the whole suite.
# Both set up what they need in .venv first; nothing else is needed but Python ≥ 3.11.

PYTHON ?= python3
CASES ?= 3000  # of everything that make fuzz changes and has read
BIN := .venv/bin
RUN := .venv/.ready-to-run
DEV := .venv/.ready-to-test

# uv leaves it to the first start to compile what Python reads; kept, every other is 2 s shorter.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: demo test fuzz fast lint bench lock recording clean

demo: $(RUN)
	$(BIN)/kumite studio sparring

test: lint
	$(BIN)/python -m kumite.warm  # once, before each worker does
	$(BIN)/python -m pytest -n 2 --dist loadfile
	NUMBA_DISABLE_JIT=1 $(BIN)/python -m pytest -m jit_off

fast: $(DEV)
	$(BIN)/python -m pytest -m "not slow"

fuzz: $(DEV)
	$(BIN)/python -m tests.fuzz --cases $(CASES)
	KUMITE_FUZZ=$(CASES) $(BIN)/python -m pytest tests/fuzz/test_socket.py

lint: $(DEV)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/basedpyright --level error
	$(BIN)/lint-imports

bench: $(RUN)
	$(BIN)/kumite bench

$(RUN): pyproject.toml requirements/run.txt
	@$(PYTHON) requirements/install.py run
	@touch $@

$(DEV): pyproject.toml requirements/run.txt requirements/dev.txt
	@$(PYTHON) requirements/install.py dev
	@touch $(RUN) $@

# Renews requirements/: the newest versions that pyproject.toml allows, on every system.
LOCK := uv --quiet pip compile --universal --python-version 3.11 --generate-hashes --upgrade \
    --no-header --no-annotate
lock: export PATH := $(CURDIR)/$(BIN):$(PATH)
lock: $(RUN)
	echo uv | $(LOCK) - -o requirements/uv.txt
	$(LOCK) pyproject.toml --group build --extra physics -o requirements/run.txt
	$(LOCK) pyproject.toml --group build --all-extras -c requirements/run.txt -o requirements/dev.txt

# The recorded fight that the studio shows while a scene is prepared for the first time.
recording: $(RUN)
	$(BIN)/kumite run sparring --seconds 16 --seed 2 --out src/kumite/studio/sparring.rec

clean:
	rm -rf .venv build dist .pytest_cache .ruff_cache .hypothesis src/kumite.egg-info
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
