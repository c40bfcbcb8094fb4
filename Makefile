# Interpreter to set up with (CPython 3.11 to 3.13); empty: the newest found.
PYTHON ?=
# Folder of the field data, which may not be copied into the project; empty: their sections stay.
FIELD_DATA ?=
FIELD_OPTION = $(if $(FIELD_DATA),--field-data $(FIELD_DATA))

STEPS := benchmarks/controller_step.py benchmarks/estimator_step.py

.DEFAULT_GOAL := help
.PHONY: help setup demo test faults fuzz verify evaluate bench nightly lint golden docs bags clean

help:  ## Show this list
	@sed -n 's/^\([a-z]*\):.*## /  make \1\t/p' Makefile | expand -t 16

setup:  ## Make .venv and build the workspace (all other targets include it)
	@sh tools/setup.sh $(PYTHON)

demo: setup  ## Drive onto a soft patch without and with control; table, picture, bags
	@.venv/bin/traction demo

test: setup  ## Run the tests, two at a time: first without real processes, then with them
	@.venv/bin/python -m pytest -n 2 -m 'not process and not nightly'; cores=$$?; \
	.venv/bin/python -m pytest -n 2 --dist loadfile -m 'process and not nightly' && exit $$cores

faults: setup  ## Inject faults into the running suite, measure their effects: docs/safety.md
	@.venv/bin/traction faults

fuzz: setup  ## A million fuzzed CAN frames, 100,000 damaged bags, YAML and CSV files (test runs 1 %)
	@TRACTION_FUZZ_SHARE=1 .venv/bin/python -m pytest -s --tb=short tests/test_fuzz.py

verify: setup  ## Compare the model with Chrono, the paper and wheel tests: docs/verification.md
	@.venv/bin/traction verify $(FIELD_OPTION)

evaluate: setup  ## Slip control in closed loop over 2,048 draws, and estimation: docs/control.md
	@.venv/bin/traction evaluate $(FIELD_OPTION)

bench: setup  ## Times of a step of control and estimation; the model's speed against scipy and Octave
	@.venv/bin/python -m pytest --benchmark-only --benchmark-columns=median,min,max,rounds $(STEPS)
	@.venv/bin/python benchmarks/model.py

nightly: setup  ## Long tests: all faults, and a million steps without memory growth
	@.venv/bin/python -m pytest -m nightly
	@.venv/bin/python -m pytest -s --benchmark-skip $(STEPS)

lint: setup  ## Check style, types of the cores, and package.xml files
	@.venv/bin/ruff check
	@.venv/bin/ruff format --check
	@.venv/bin/mypy
	@.venv/bin/python tools/check_packages.py

golden: setup  ## Replay all bags and write the outputs to tests/golden
	@for bag in bags/*/; do \
	  .venv/bin/traction replay $$bag --golden tests/golden/$$(basename $$bag).golden || exit 1; \
	done; git --no-pager diff --stat tests/golden

docs: setup  ## Write parameter files and README tables from the parameters of the nodes
	@.venv/bin/python -m traction_bringup.parameter_docs ros2_ws/src

bags: setup  ## Write the bags in bags/ again from their CSV files
	@.venv/bin/traction bag make

clean:  ## Remove the outputs of the other targets
	rm -rf .venv ros2_ws/build ros2_ws/install ros2_ws/log out
