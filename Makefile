# make demo and make test are the whole set-up: each makes its virtual environment first, once.
#
#   make test PYTHON=python3.13    another interpreter gets an environment of its own

PYTHON ?= python3
VERSION := $(shell $(PYTHON) -c 'import sys; print("%d.%d" % sys.version_info[:2])' 2>/dev/null)
VENV := $(if $(filter python3,$(PYTHON)),.venv,.venv-$(VERSION))
BIN := $(VENV)/bin
READY := $(VENV)/.ready
KERNELS := $(VENV)/.kernels
# Tests start many processes: each would compile the sources again.
unexport PYTHONDONTWRITEBYTECODE
MEASURES := $(VENV)/.measures
PEERS := $(VENV)/.peers
# Whole reports; docs/measured has what a reader needs of them.
MEASURED := build/measured

# Where the programs of tests and benchmarks find each other.
MODULES := tests/support:benchmarks
# What runs whole daemons, in real time: of these `make test` runs one demo, one client, one page in a browser, and an
# example of each fault that only a process can have.
DAEMONS := tests/system
ONE_OF_EACH := $(addprefix $(DAEMONS)/test_,demo.py readme_program.py \
	page.py::test_the_numbers_of_a_finger_are_those_of_the_message \
	page.py::test_a_change_of_the_grip_force_reaches_the_gripper \
	page.py::test_sensors_that_fall_silent_are_unknown_with_the_reason \
	service.py::test_P1_a_failure_of_the_engine_ends_the_run_and_is_raised \
	service_process.py::test_P4_a_signal_ends_the_process_well[15] \
	service_unit.py::test_P2_P5_a_daemon_that_crashes_or_hangs_is_started_again_without_limit \
	leaks.py::test_P6_runs_that_end_leave_no_descriptor_and_no_task)
# Programs of long runs: their targets test them first. `make check` imports them, and runs the quick tests of some.
EVALUATION := $(addprefix benchmarks/,evaluate fit second_world)
LONG := $(addprefix benchmarks/,evaluate/test_calm.py evaluate/test_offline_grasp.py fit second_world/test_rubber_trace.py \
	bench campaign chart soak)
# The tests of one file stay together on one core: they share a daemon, or what takes long to compute.
PYTEST := $(BIN)/pytest --quiet --numprocesses=2 --dist loadfile --no-loadscope-reorder
# `make check` alone tests fleets, ROS 2, viewers, simulated scenes, kernels that are not compiled or not warmed up, how
# much a decoder calls, what guides a person, and what draws, imports and exports recordings.
LATER := $(addprefix tests/unit/,client/fleet/test_bridge.py client/fleet/test_fleet_command.py client/ros \
	client/test_viewers.py devices/test_bounded_work.py engine/test_warm_up.py fusion/test_compiled.py \
	tools/commission tools/discovery tools/evaluation tools/export tools/plot tools/recordings tools/sim \
	tools/test_carry_story.py tools/test_faulty_recordings.py)

.PHONY: install uninstall demo test check lint portable bench chart pictures evaluate fuzz soak peers dist clean

demo: $(KERNELS)
	@echo "== slipd demo: the daemon on the virtual gripper (Ctrl-C ends it)"
	@$(BIN)/slipd demo $(DEMO)

ifdef TESTS
test: $(KERNELS) lint
	@$(BIN)/pytest $(TESTS)
else
test: $(KERNELS) lint
	@echo "== tests of the service and its clients, one demo, one client, one page (three minutes on two idle cores)"
	@$(PYTEST) -m "not long and not statistics" $(addprefix --ignore=,$(LATER)) $(ONE_OF_EACH) tests/unit
endif

check: $(KERNELS) lint
	@echo "== all tests but those of long runs, with coverage (about 10 minutes on two idle cores)"
	@$(PYTEST) -m "not long" --cov --cov-report= $(addprefix --ignore=,$(LONG)) benchmarks tests
	@echo "== every branch of the rooms that decide, and of those that guide a person, is tested"
	@$(BIN)/coverage report --fail-under=100 --precision=2
	@PYTHONPATH=tests/support $(BIN)/python -m browser

lint: $(READY)
	@echo "== ruff, mypy, import-linter"
	@$(BIN)/ruff format --check .
	@$(BIN)/ruff check .
	@$(BIN)/mypy
	@$(BIN)/mypy --python-version 3.10 --disable-error-code no-any-return --no-warn-unused-ignores --package slipd_client
	@$(BIN)/lint-imports

portable: $(KERNELS) $(MEASURED)
	@echo "== numeric tests as on older processors (about 10 minutes)"
	@PYTHONPATH=$(MODULES) $(BIN)/python -m portable --report $(MEASURED)/portability.md $(PORTABLE)

bench: $(MEASURES) $(MEASURED)
	@echo "== the daemon and the friction limit beside C and others; a million contacts (about 18 minutes)"
	@$(BIN)/pytest --quiet benchmarks/bench
	@PYTHONPATH=$(MODULES) $(BIN)/python -m bench.latency --report $(MEASURED)/bench.md $(BENCH)

chart: $(MEASURES) $(MEASURED)
	@echo "== every method of the friction limit on the same contacts: speed, accuracy, failures (about 10 minutes)"
	@$(BIN)/pytest --quiet benchmarks/chart
	@PYTHONPATH=$(MODULES) $(BIN)/python -m chart --into $(MEASURED) $(CHART)

pictures: $(READY)
	@echo "== the live view in a browser, as pictures (needs Chromium; on an idle machine)"
	@PYTHONPATH=$(MODULES) $(BIN)/python -m livepage.pictures $(PICTURES)

evaluate: $(MEASURES) $(MEASURED)
	@echo "== warnings and reports of slip on simulated grasps, against what really happened (about 20 minutes)"
	@$(BIN)/pytest --quiet -m "not long" $(EVALUATION)
	@PYTHONPATH=$(MODULES) $(BIN)/python -m evaluate --into $(MEASURED) $(EVALUATE)

fuzz: $(KERNELS)
	@echo "== every split of every device's frames, a million damaged frames, 2 GB of noise, every byte of a recording"
	@FUZZ_ROUNDS=250 $(BIN)/pytest --quiet --numprocesses=2 --timeout=3600 tests/unit/devices/test_every_decoder.py tests/unit/recording/test_reader.py

soak: $(KERNELS) $(MEASURED)
	@echo "== real lines unplugged and flooded, full load, stalled subscribers, hours of simulated faults and of simulated work (about two hours)"
	@$(BIN)/pytest --quiet benchmarks/soak benchmarks/campaign
	@$(BIN)/pytest --quiet -m long tests benchmarks
	@PYTHONPATH=$(MODULES) $(BIN)/python -m soak --report $(MEASURED)/soak.md $(SOAK)
	@PYTHONPATH=$(MODULES) $(BIN)/python -m campaign $(CAMPAIGN)

peers: $(PEERS)
	@echo "== emulated devices beside drivers that others wrote (about a minute)"
	@PYTHONPATH=$(MODULES) $(BIN)/python -m peers --report docs/measured/peers.md

dist: $(READY)
	@echo "== the wheels: slipd for the robot PC, slipd_client for other machines and environments"
	@rm -rf dist
	@$(BIN)/python -m pip wheel --quiet --disable-pip-version-check --no-build-isolation --no-deps --wheel-dir dist . ./clients
	@ls dist/*

$(MEASURED):
	@mkdir -p $@

# What only the measurements need: rival solvers and a plotting library.
$(MEASURES): $(KERNELS)
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[dev,chart]'
	@touch $@

# What only the comparison with other programs needs.
$(PEERS): $(READY)
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[dev,peers]'
	@touch $@

# The environment is made again when the dependencies change; a stamp tells, so that a second run starts at once.
$(READY): pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null \
		|| { echo "slipd needs Python 3.11 or newer; $(PYTHON) $(if $(VERSION),is $(VERSION),cannot be run)." \
			"Name another: make $(MAKECMDGOALS) PYTHON=python3.12"; exit 2; }
	@echo "== setting up $(VENV) with Python $(VERSION) (once; about a minute)"
	@$(PYTHON) -m venv $(VENV) || { echo "venv failed; on Debian: apt install python3-venv"; exit 2; }
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[dev]'
	@touch $@

$(KERNELS): $(READY)
	@$(BIN)/python -m slipd.compile_kernels
	@touch $@

# For all users as root, or into DESTDIR; else for this user, without root. docs/service.md
PREFIX ?= /usr/local
override PREFIX := $(patsubst ~/%,$(HOME)/%,$(PREFIX))
HOME_OF_PROGRAM := $(DESTDIR)$(PREFIX)/lib/slipd
UNPRIVILEGED := $(if $(DESTDIR),,$(filter-out 0,$(shell id -u)))
SERVICE = "$(HOME_OF_PROGRAM)/bin/python" -B -m slipd service $(1) $(if $(UNPRIVILEGED),--user,--system) \
	--program "$(PREFIX)/bin/slipd" $(if $(DESTDIR),--root "$(DESTDIR)")
# Exchanges two folders in one step: every moment has a whole slipd.
EXCHANGE := import ctypes, os, sys; \
	sys.exit(ctypes.CDLL(None).renameat2(-100, os.fsencode(sys.argv[1]), -100, os.fsencode(sys.argv[2]), 2) != 0)
NO_CACHE := $(shell [ -w "$(HOME)" ] || echo --no-cache-dir)

install:
ifeq ($(UNPRIVILEGED),)
	@case "$$($(PYTHON) -c 'import os, sys; print(os.path.realpath(sys.executable))')" in /home/*|/root/*) \
		echo "The service cannot run a Python of one user's home. Name another: make install PYTHON=/usr/bin/python3"; exit 2;; esac
endif
	@[ -e "$(HOME_OF_PROGRAM)/pyvenv.cfg" ] || [ -z "$$(ls -A "$(HOME_OF_PROGRAM)" 2>/dev/null)" ] || { \
		echo "$(HOME_OF_PROGRAM) holds something else, which make install does not replace. Name another PREFIX."; exit 2; }
	@echo "== slipd into $(HOME_OF_PROGRAM)"
	@umask 022; mkdir -p "$(DESTDIR)$(PREFIX)/lib" "$(DESTDIR)$(PREFIX)/bin" \
		&& [ -w "$(DESTDIR)$(PREFIX)/lib" ] && [ -w "$(DESTDIR)$(PREFIX)/bin" ] || { \
		echo "$(DESTDIR)$(PREFIX) cannot be written. Name a place that you may write to: make install PREFIX=$(if $(filter $(HOME)/%,$(PREFIX)),/PLACE,~/.local)"; exit 2; }
	@set -e; umask 022; new=$$(mktemp -d "$(HOME_OF_PROGRAM).XXXXXX"); trap 'rm -rf "$$new"' EXIT; \
	$(PYTHON) -m venv "$$new"; \
	"$$new/bin/python" -m pip install --quiet --disable-pip-version-check $(NO_CACHE) . \
		|| { echo "== pip failed; nothing was changed"; exit 2; }; \
	grep -rlIF "$$new" "$$new/bin" "$$new/pyvenv.cfg" | xargs sed -i "s|$$new|$(PREFIX)/lib/slipd|g"; \
	chmod -R u+rwX,go+rX,go-w "$$new"; \
	if [ -e "$(HOME_OF_PROGRAM)" ]; then \
		$(PYTHON) -c '$(EXCHANGE)' "$$new" "$(HOME_OF_PROGRAM)" \
			|| { mv "$(HOME_OF_PROGRAM)" "$$new.old"; mv "$$new" "$(HOME_OF_PROGRAM)"; rm -rf "$$new.old"; }; \
	else mv "$$new" "$(HOME_OF_PROGRAM)"; fi
	@for program in slipd slipctl; do ln -sf "$(PREFIX)/lib/slipd/bin/$$program" "$(DESTDIR)$(PREFIX)/bin/$$program"; done
	@$(call SERVICE,install) || echo "== no systemd unit; slipd run works without"
	@echo "== installed; docs/service.md says more"

uninstall:
	@[ ! -e "$(HOME_OF_PROGRAM)/pyvenv.cfg" ] || { \
		$(call SERVICE,uninstall) || echo "== a systemd unit, if there is one, is left"; \
		rm -rf "$(HOME_OF_PROGRAM)"; }
	@for program in slipd slipctl; do \
		[ "$$(readlink "$(DESTDIR)$(PREFIX)/bin/$$program")" != "$(PREFIX)/lib/slipd/bin/$$program" ] || rm "$(DESTDIR)$(PREFIX)/bin/$$program"; done
	@echo "== uninstalled; configs, keys, recordings and udev rules that were changed are kept"

clean:
	rm -rf .venv .venv-* .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache .coverage*
