# The commands of the README. The work is done by .ci/setup (packages, .venv, build), CMake and pytest.
#
#   make demo     set up, build, and run the main job on a recording
#   make test     set up, build, and run all tests
#   make docs     set up, build, and build the site: build/docs/html/index.html; a warning is an error
#   make setup    set up and build: .venv/bin/diffnea and the Python module
#   make bench    run the benchmarks
#   make peers    measure beside Pinocchio, MuJoCo, FIGAROH, MJX, Brax and CMA-ES (three hours; tests/benchmarks/peers)
#   make study    hide effects in hundreds of recordings and diagnose them; can be stopped and resumed
#   make asan     all C++ tests and the command's, under AddressSanitizer and UndefinedBehaviorSanitizer
#   make tsan     what uses threads, under ThreadSanitizer
#   make coverage which lines of include/ and src/ the C++ tests run: build/coverage/lines/index.html
#   make clean    delete what was built; .venv stays

BUILD := build/release
JOBS ?= $(shell nproc)
# A file's tests stay in one process: they share recordings and runs.
PYTEST = .venv/bin/python -m pytest -m "not study" --numprocesses $(JOBS) --dist loadfile

.PHONY: help setup demo test docs bench peers study asan tsan coverage clean

help:
	@sed -n 's/^#   //p' Makefile

setup:
	.ci/setup

demo: setup
	.ci/demo

test:
	.ci/setup --tests
	ctest --test-dir $(BUILD) --parallel $(JOBS) --output-on-failure --label-exclude study
	$(PYTEST)

docs:
	.ci/setup --docs
	.venv/bin/python -m sphinx -q -W --keep-going docs build/docs/html

bench:
	.ci/setup --tests
	cmake --build $(BUILD) --target diffnea_benchmarks diffnea_bench_identify diffnea_bench_ball diffnea_bench_policy
	$(BUILD)/tests/benchmarks/diffnea_benchmarks
	$(BUILD)/tests/benchmarks/diffnea_bench_identify
	$(BUILD)/tests/benchmarks/diffnea_bench_ball
	$(BUILD)/tests/benchmarks/diffnea_bench_policy

peers:
	.ci/setup --tests
	cmake --build $(BUILD) --target servo_runs
	.venv/bin/python -m venv build/peers/venv
	build/peers/venv/bin/pip install --quiet --requirement tests/benchmarks/peers/requirements.txt
	build/peers/venv/bin/python tests/benchmarks/peers/run.py build/peers

study:
	.ci/setup --tests
	.venv/bin/python tests/hidden_effects/study.py $(BUILD) --set report --jobs $(JOBS) -o build/study

# The command's tests run the instrumented command, and the module of `make test`.
COMMAND_TESTS := $(wildcard tests/python/cli_*_test.py) tests/python/threads_test.py tests/python/killed_test.py

asan tsan: export DIFFNEA_COMMAND_SECONDS = 1800
asan tsan: export UBSAN_OPTIONS = print_stacktrace=1
asan tsan: export TSAN_OPTIONS = halt_on_error=1 suppressions=$(CURDIR)/tests/tsan.supp

asan:
	.ci/setup --tests
	cmake --preset asan && cmake --build --preset asan --target diffnea_tests diffnea_app
	ctest --preset asan --parallel $(JOBS) --label-exclude study
	DIFFNEA_COMMAND=$(CURDIR)/build/asan/apps/diffnea $(PYTEST) $(COMMAND_TESTS)

tsan:
	.ci/setup --tests
	cmake --preset tsan && cmake --build --preset tsan --target diffnea_tests diffnea_app
	build/tsan/tests/diffnea_tests "[threads]"
	DIFFNEA_COMMAND=$(CURDIR)/build/tsan/apps/diffnea $(PYTEST) tests/python/threads_test.py

# By breakpoints (kcov, of apt) in place of counters: these would grow with every inlined function of Eigen, and take the
# compilers four times as long. Tag by tag: of what comes after a test that forks, kcov sees nothing.
coverage:
	@command -v kcov >/dev/null || { echo "make coverage needs kcov: sudo apt-get install kcov" >&2; exit 1; }
	.ci/setup --tests
	cmake --preset coverage && cmake --build --preset coverage --target diffnea_tests
	build/coverage/tests/diffnea_tests --list-tags | grep -o '\[.*\]' | while read -r tag; do \
	  kcov --include-path=$(CURDIR)/include,$(CURDIR)/src build/coverage/lines build/coverage/tests/diffnea_tests "$$tag" </dev/null; done

clean:
	rm -rf build dist
