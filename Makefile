# armgap: `make help` lists the targets.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
RUST_SOURCES := $(shell find rust -name '*.rs' -o -name Cargo.toml 2>/dev/null) Cargo.toml Cargo.lock

.DEFAULT_GOAL := help
.PHONY: help setup demo test check check-lints check-tests licences lint test-rust test-python reproduce bench bench-baselines bench-dynamics bench-ferromotion bench-instructions header dist docs wheel wheel-check clean all tools lint-tools

help: ## list the targets
	@grep -E '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:[^#]*## /\t/' | expand -t 16

tools:
	@command -v cargo >/dev/null || { echo "armgap needs Rust: cargo was not found; install it from https://rustup.rs" >&2; exit 1; }
	@command -v cc >/dev/null || { echo "armgap needs a C linker: cc was not found; install gcc or clang" >&2; exit 1; }
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null || { echo "armgap needs Python 3.11 or newer as $(PYTHON); set PYTHON=..." >&2; exit 1; }
	@$(PYTHON) -c 'import venv, ensurepip' 2>/dev/null || { echo "armgap needs the venv module of $(PYTHON); on Debian: apt-get install python3-venv" >&2; exit 1; }

lint-tools: tools
	@{ cargo clippy --version && cargo fmt --version; } >/dev/null 2>&1 || { echo "make test needs clippy and rustfmt: rustup component add clippy rustfmt" >&2; exit 1; }

$(VENV)/.tools: pyproject.toml | tools
	@test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	@$(BIN)/python -m pip install -q --disable-pip-version-check "maturin>=1.9,<2"
	@touch $@

$(VENV)/.built: $(VENV)/.tools pyproject.toml $(RUST_SOURCES)
	@echo "building armgap (some minutes the first time)"
	@PIP_QUIET=1 PIP_DISABLE_PIP_VERSION_CHECK=1 VIRTUAL_ENV=$(CURDIR)/$(VENV) $(BIN)/maturin develop -q --release --extras trial,formats,ros,dev,docs
	@touch $@

setup: $(VENV)/.built ## virtual environment and build, all that the other targets need

demo: setup ## diagnose the sample log, or yours: make demo LOG="a.csv b.csv" ARM=arm.toml HOLDOUT=c.csv COLUMNS=.. UNITS=..
	@$(BIN)/armgap demo $(LOG) $(if $(ARM),--arm $(ARM)) $(foreach h,$(HOLDOUT),--holdout $(h)) $(if $(COLUMNS),--columns "$(COLUMNS)") $(if $(UNITS),--units "$(UNITS)")

lint: setup lint-tools ## formatting, types and stubs
	$(BIN)/ruff format --check python tests examples tools
	$(BIN)/ruff check python tests examples tools
	$(BIN)/mypy
	$(BIN)/python -m mypy.stubtest armgap._native --mypy-config-file pyproject.toml
	cargo fmt --check
	PYO3_PYTHON=$(CURDIR)/$(BIN)/python cargo clippy -q --release --all-targets -p armgap-core -p armgap-fit -p armgap-capi -p armgap-bench -p armgap-benches -p armgap-py -- -D warnings

check: setup lint-tools ## formatting, lints and the fast tests side by side, in less than a minute once built
	@$(MAKE) --no-print-directory -j2 -Otarget check-lints check-tests

check-lints:
	$(BIN)/ruff format --check python tests examples tools
	$(BIN)/ruff check python tests examples tools
	$(BIN)/mypy
	cargo fmt --check
	PYO3_PYTHON=$(CURDIR)/$(BIN)/python cargo clippy -q --release -p armgap-core -p armgap-fit -p armgap-capi -p armgap-py -- -D warnings

check-tests:
	$(BIN)/python -m pytest -m "not slow" -n auto

licences: setup ## write docs/licences.md from the dependencies
	$(BIN)/python tools/licences.py docs/licences.md

test-rust: tools ## the Rust tests
	cargo test -q --release
	cargo test -q --release --doc -p armgap-bench
	rust/embed/check.sh

test-python: setup ## the Python tests
	$(BIN)/python -m pytest

test: lint test-rust test-python ## everything that has to hold

reproduce: setup ## the seed paper's tables and figures beside our own
	$(BIN)/armgap reproduce

bench: ## cost per sample, per step and per effect of the core
	cargo bench -p armgap-benches

bench-baselines: $(VENV)/.built ## the core beside plain C, numpy, padasip, filterpy, MuJoCo, Pinocchio and scipy
	$(BIN)/python -m pip install -q --disable-pip-version-check $$($(BIN)/python -c "import tomllib; print(*tomllib.load(open('pyproject.toml', 'rb'))['project']['optional-dependencies']['baselines'])")
	cargo run -q --release -p armgap-benches --bin baselines
	cargo run -q --release -p armgap-benches --bin online_chain
	$(BIN)/python benches/baselines/compare.py
	$(BIN)/python benches/baselines/fit.py

bench-dynamics: $(VENV)/.tools ## dynamics of serial arms beside Pinocchio in C++ (CXX, Eigen's headers), for any processor and for this one
	$(BIN)/python -m pip install -q --disable-pip-version-check "pin>=3.0"
	cargo run -q --release -p armgap-benches --features pinocchio --bin chain
	CARGO_TARGET_DIR=target/native RUSTFLAGS="-C target-cpu=native" cargo run -q --release -p armgap-benches --features pinocchio --bin chain

bench-ferromotion: tools ## the core's rollout beside the crate ferromotion, which is downloaded and takes minutes to compile
	CARGO_TARGET_DIR=target/ferromotion cargo run -q --release --manifest-path benches/ferromotion/Cargo.toml

bench-instructions: tools ## instructions per sample, counted one by one
	cargo build -q --release -p armgap-benches --bin instructions
	$(PYTHON) benches/instructions.py target/release/instructions

header: tools ## write rust/capi/include/armgap.h from the sources
	ARMGAP_WRITE_HEADER=1 cargo test -q --release -p armgap-capi --test header

dist: tools ## the C library for controllers: header, libraries, example, in dist/
	cargo build -q --release -p armgap-capi
	cargo rustc -q --profile embed -p armgap-capi --no-default-features --features freestanding --crate-type staticlib --target-dir target/freestanding
	@rm -rf dist/armgap-c && mkdir -p dist/armgap-c/include dist/armgap-c/freestanding
	@cp rust/capi/include/armgap.h dist/armgap-c/include/ && cp LICENSE examples/controller/controller.c examples/controller/README.md dist/armgap-c/
	@cp target/release/libarmgap.a target/release/libarmgap.so dist/armgap-c/ && cp target/freestanding/embed/libarmgap.a dist/armgap-c/freestanding/
	@cc -O2 -Wall -Wextra -Werror -I dist/armgap-c/include dist/armgap-c/controller.c dist/armgap-c/freestanding/libarmgap.a -lm -o dist/controller && dist/controller > /dev/null && rm dist/controller
	@tar -C dist -czf dist/armgap-c.tar.gz armgap-c && echo "dist/armgap-c.tar.gz"

wheel: $(VENV)/.tools ## a wheel in dist/
	@rm -f dist/armgap-*.whl
	$(BIN)/maturin build --release -o dist

wheel-check: wheel ## the wheel, installed where there is no Rust: demo, diagnose, export, import time
	$(PYTHON) tests/check_wheel.py dist/armgap-*.whl

docs: setup ## the documentation site in dist/site
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --strict --quiet
	@echo "the site is in dist/site; with search: $(BIN)/python -m http.server -d dist/site"

all: test demo ## what has to hold before a change lands

clean: ## remove everything that was built
	rm -rf $(VENV) target dist
