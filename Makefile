# Two commands for a newcomer: `make demo` and `make test`. Each sets up what it needs.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready
# System libraries of the open3d and pymeshlab wheels, text layout of PDF reports, filters of system calls, a
# compiler for the kernels, venv.
SYSTEM := libegl1 libgl1 libopengl0 libusb-1.0-0 \
    libpango-1.0-0 libpangoft2-1.0-0 libharfbuzz-subset0 fonts-dejavu-core libseccomp2 \
    g++ python3-venv
HOST ?= 127.0.0.1
PORT ?= 8000

.DEFAULT_GOAL := help
.PHONY: help setup demo serve test nightly coverage servers check tidy format bench image-test lock secrets sbom \
    openapi docs clean

help: ## list the commands
	@grep -E '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 12

setup: $(READY) ## make .venv with everything installed

$(READY): pyproject.toml constraints.txt CMakeLists.txt $(wildcard pipeline/kernels/native/*pp)
	@missing=""; for package in $(SYSTEM); do \
	    dpkg-query -W -f '$${Status}' $$package 2>/dev/null | grep -q 'install ok' || missing="$$missing $$package"; \
	done; \
	if [ -z "$$missing" ] || ! command -v dpkg-query >/dev/null; then exit 0; fi; \
	if [ "$$(id -u)" = 0 ]; then \
	    apt-get update -qq && apt-get install -y -qq --no-install-recommends $$missing >/dev/null; \
	else \
	    echo "System libraries are missing. Run this once, then make again:"; \
	    echo "    sudo apt-get install -y --no-install-recommends$$missing"; exit 1; \
	fi
	$(PYTHON) -c 'import sys; assert sys.version_info >= (3, 11), "Python 3.11 or newer is needed: make PYTHON=python3.11 ..."'
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt --editable '.[dev]'
	-@$(BIN)/python -m compileall -q $(VENV)/lib >/dev/null 2>&1 # start-up in 2 s also where Python writes no caches
	$(BIN)/python -c 'import pipeline; pipeline.preload()'
	@touch $@

demo: $(READY) ## register a generated dental arch to its "print", through the whole service
	$(BIN)/cusp demo

serve: $(READY) ## start the service on HOST:PORT
	$(BIN)/cusp up --host $(HOST) --port $(PORT)

# Compiled tests are kept for the next worker, and solvers take one thread. Three workers on two cores: many
# tests wait for a service.
# Tests write databases that wait for the disk; in memory, where there is some, they do not wait.
TEST_TMP := $(shell free=$$(df -Pk /dev/shm 2>/dev/null | awk 'NR == 2 {print $$4}'); \
    [ "$${free:-0}" -gt 4000000 ] && echo /dev/shm || echo "$${TMPDIR:-/tmp}")
PYTEST := TMPDIR=$(TEST_TMP) PYTHONDONTWRITEBYTECODE= OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest --durations=20

test: $(READY) servers ## all tests but the nightly ones; those marked `data` need CUSP_DATA
	$(PYTEST) -n 3 --dist loadfile --no-loadscope-reorder

nightly: $(READY) servers tidy sbom ## the long tests: 2,400 broken meshes, 100,000 changed files, the C++ core under sanitizers, 300 requests an address, every kill and restart, known vulnerabilities
	CUSP_TEST_NIGHTLY=1 $(PYTEST) -m nightly --timeout 3600

coverage: $(READY) servers ## the tests of `make test` in one process, with the coverage of both packages
	$(PYTEST) --cov=pipeline --cov=service --cov-report=term

servers: | $(READY) # after it, as both may need apt. PostgreSQL, which tests start themselves (Debian keeps its commands off the PATH), and a browser
	@if command -v chromium >/dev/null; then :; elif [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null; then \
	    apt-get update -qq && apt-get install -y -qq --no-install-recommends chromium fonts-dejavu-core >/dev/null || true; \
	else echo "No Chromium is installed (apt-get install chromium): tests of the page are skipped."; fi
	@if command -v initdb >/dev/null || ls /usr/lib/postgresql/*/bin/initdb >/dev/null 2>&1; then exit 0; fi; \
	if [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null; then \
	    apt-get update -qq && apt-get install -y -qq --no-install-recommends postgresql >/dev/null; \
	else \
	    echo "No PostgreSQL is installed (apt-get install postgresql): tests that need it are skipped."; \
	fi

check: $(READY) ## ruff, clang-format, mypy strict on both packages, the import order
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/clang-format --dry-run --Werror pipeline/kernels/native/*pp
	$(BIN)/mypy
	$(BIN)/lint-imports

format: $(READY) ## format the code and fix what ruff can fix
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .
	$(BIN)/clang-format -i pipeline/kernels/native/*pp

image-test: $(READY) ## build the image, run it and the compose file, register the demo through each, stop them
	$(BIN)/python -m tests.image

# The versions of constraints.txt, each with the hashes of its files: what the image is built from.
LOCK = uv pip compile --quiet --universal --python-version 3.11 --generate-hashes --no-header --no-annotate \
    --constraint constraints.txt
lock: ## write image/*.lock after a change of constraints.txt; needs uv
	$(LOCK) --extra formats --excludes image/excluded.txt pyproject.toml -o image/requirements.lock
	$(LOCK) image/build.in -o image/build.lock

secrets: ## make the passwords of the compose file's scale profile, once
	image/secrets.sh

sbom: $(READY) ## write build/sbom.cdx.json: what the image is made of, in CycloneDX
	@mkdir -p build
	$(BIN)/python -m cyclonedx_py requirements image/requirements.lock --pyproject pyproject.toml \
	    --output-reproducible --validate --output-file build/sbom.cdx.json

tidy: $(READY) ## clang-tidy on the C++ core
	$(BIN)/clang-tidy --quiet pipeline/kernels/native/*.cpp -- -std=c++20 -w \
	    $$($(BIN)/python -c 'import nanobind, sysconfig; print("-isystem", nanobind.include_dir(), "-isystem", sysconfig.get_path("include"))')

openapi: $(READY) ## write openapi/openapi.json and its examples
	$(BIN)/cusp openapi

docs: $(READY) ## write the generated parts of docs/
	$(BIN)/python -m docs.generate

bench: $(READY) ## accuracy and time on formula shapes and, with CUSP_DATA, on real ones
	$(BIN)/python -m tests.accuracy.geodesics
	$(BIN)/python -m tests.accuracy.job_costs
	$(BIN)/python -m tests.accuracy.teeth
	$(BIN)/python -m tests.accuracy.landmarks
	$(BIN)/python -m tests.accuracy.bench
	$(BIN)/python -m tests.accuracy.deviation
	$(BIN)/python -m tests.accuracy.dense_scans --register
	$(BIN)/python -m tests.accuracy.budgets --large
	$(BIN)/python -m tests.endurance.load
	$(BIN)/python -m tests.endurance.chaos
	$(BIN)/python -m tests.endurance.watchers
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt kiss-matcher
	$(BIN)/python -m tests.accuracy.gauntlet --seeds 1 --peers --out gauntlet.jsonl

clean: ## remove what setup and the tools made
	rm -rf $(VENV) .mypy_cache .ruff_cache .pytest_cache .hypothesis build dist
