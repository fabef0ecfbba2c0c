# Two commands do everything on a fresh machine: `make demo` and `make test`.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
OUT ?= out

.PHONY: demo test check bench reproduce rust-test clean

## Build, install into .venv, run the scenarios: tables on the screen, figures in $(OUT).
demo: $(VENV)/installed
	$(BIN)/losnav run landmark-landing --runs 100 --out $(OUT)/landmark-landing
	@echo
	$(BIN)/losnav run relative-navigation --runs 100 --out $(OUT)/relative-navigation
	@echo
	$(BIN)/losnav run sun-line-of-sight --runs 100 --out $(OUT)/sun-line-of-sight
	@echo
	$(BIN)/losnav run small-body-landing --runs 10 --out $(OUT)/small-body-landing
	@echo
	$(BIN)/losnav run star-tracker --runs 100 --out $(OUT)/star-tracker
	@echo
	$(BIN)/python examples/first_pose.py

## The whole test suite: Rust, then Python.
test: $(VENV)/installed-test rust-test
	$(BIN)/python -m pytest

rust-test:
	cargo test --release --workspace --quiet

## Formatting, lints, types, the stub, documentation, and the core without std.
check: $(VENV)/installed-test
	cargo fmt --all --check
	cargo clippy --workspace --all-targets --quiet -- -D warnings
	cargo build --quiet -p losnav-core --no-default-features --features libm
	RUSTDOCFLAGS="-D warnings" cargo doc --workspace --no-deps --quiet
	$(BIN)/ruff check python tests benches examples
	$(BIN)/ruff format --check python tests benches examples
	$(BIN)/python -m mypy
	$(BIN)/python -m mypy.stubtest losnav._core

## Kernels and peers in one run; rewrites benches/RESULTS.md.
bench: $(VENV)/installed-bench
	$(BIN)/python benches/run.py

## The published claims, judged one by one.
reproduce: $(VENV)/installed
	$(BIN)/losnav reproduce all --out $(OUT)/reproduce

SOURCES := Cargo.toml Cargo.lock pyproject.toml $(shell find rust python -name '*.rs' -o -name '*.toml' -o -name '*.py')

$(BIN)/python:
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade pip

$(VENV)/installed: $(BIN)/python $(SOURCES)
	$(BIN)/python -m pip install --quiet --editable ".[plot,cli]"
	@touch $@

$(VENV)/installed-test: $(BIN)/python $(SOURCES)
	$(BIN)/python -m pip install --quiet --editable ".[dev]"
	-$(BIN)/python -m pip install --quiet opencv-python-headless poselib distributed pyerfa jplephem skyfield-data # peers: their tests skip without
	@touch $@ $(VENV)/installed

$(VENV)/installed-bench: $(BIN)/python $(SOURCES)
	$(BIN)/python -m pip install --quiet --editable ".[bench]"
	@touch $@ $(VENV)/installed

clean:
	rm -rf $(VENV) $(OUT) target dist
