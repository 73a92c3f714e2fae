# The commands of the README. The work is done by .ci/setup (packages, .venv, build), CMake and pytest.
#
#   make demo     set up, build, and run the main job on a recording
#   make test     set up, build, and run all tests
#   make setup    set up and build: .venv/bin/diffnea and the Python module
#   make bench    run the benchmarks
#   make study    hide effects in hundreds of recordings and diagnose them; can be stopped and resumed
#   make clean    delete what was built; .venv stays

BUILD := build/release
JOBS ?= $(shell nproc)

.PHONY: help setup demo test bench study clean

help:
	@sed -n 's/^#   //p' Makefile

setup:
	.ci/setup

demo: setup
	.ci/demo

test:
	.ci/setup --tests
	ctest --test-dir $(BUILD) --parallel $(JOBS) --output-on-failure --label-exclude study
	.venv/bin/python -m pytest -m "not study"

bench:
	.ci/setup --tests
	cmake --build $(BUILD) --target diffnea_benchmarks diffnea_bench_identify diffnea_bench_ball diffnea_bench_policy
	$(BUILD)/tests/benchmarks/diffnea_benchmarks
	$(BUILD)/tests/benchmarks/diffnea_bench_identify
	$(BUILD)/tests/benchmarks/diffnea_bench_ball
	$(BUILD)/tests/benchmarks/diffnea_bench_policy

study:
	.ci/setup --tests
	.venv/bin/python tests/hidden_effects/study.py $(BUILD) --set report --jobs $(JOBS) -o build/study

clean:
	rm -rf build dist
