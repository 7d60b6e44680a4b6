# `make demo` and `make test` work from a fresh clone: they make .venv and install what they need.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready
PEERS := .venv-peers
JOBS ?= 2

# One thread each: the robot's computer is small, and results do not depend on the number of cores.
export OPENBLAS_NUM_THREADS := 1
export OMP_NUM_THREADS := 1
export LP_NUM_THREADS := 1
export MUJOCO_GL ?= egl

.PHONY: demo test test-all test-kernel lint bench bench-data bench-peers scenes clean

demo: $(READY)
	$(BIN)/robot demo

test: $(READY)
	$(BIN)/python -m pytest -n $(JOBS) --dist worksteal -m "not slow"

test-all: $(READY)
	$(BIN)/python -m pytest -n $(JOBS) --dist worksteal --cov=robot --cov=calib --cov-report=term --cov-fail-under=90

# Real V4L2 cameras and a real USB brick in an emulated computer; needs qemu-system-x86 and mmdebstrap.
test-kernel: $(READY)
	PYTHON=$(BIN)/python tests/kernel/run

lint: $(READY)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

bench: $(READY)
	$(BIN)/python -m bench.range
	$(BIN)/python -m bench.tick
	$(BIN)/python -m bench.stereo
	$(BIN)/python -m bench.freespace
	$(BIN)/python -m bench.faults
	$(BIN)/python -m bench.fuzz
	$(BIN)/python -m bench.wire
	$(BIN)/python -m bench.nmf

# Benches on real images: make bench-data DATA=folder (its layout is told by each bench's --help).
bench-data: $(READY) bench-peers
	$(BIN)/python -m bench.stereo --data $(DATA)
	$(BIN)/python -m bench.detector --data $(DATA)
	$(BIN)/python -m bench.tracker --data $(DATA)
	$(BIN)/python -m bench.diamond --data $(DATA)

# OpenCV's CSRT and KCF are in its contrib package, which would replace the robot's OpenCV: an environment of its own.
bench-peers: $(PEERS)/.ready

$(PEERS)/.ready:
	$(PYTHON) -m venv $(PEERS)
	$(PEERS)/bin/python -m pip install --quiet --disable-pip-version-check numpy opencv-contrib-python-headless
	@touch $@

scenes: $(READY)
	$(BIN)/robot run --sim all --seeds 5 --jobs $(JOBS)

clean:
	rm -rf $(VENV) $(PEERS) runs

$(READY): pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
		|| { echo "Python 3.11 or newer is needed: make PYTHON=/path/to/python3.11"; exit 2; }
	@echo "Setting up $(VENV), once; this takes a minute or two ..."
	@$(PYTHON) -m venv $(VENV)
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[sim,plots,test,bench]'
	@touch $(READY)
