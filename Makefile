# SPDX-License-Identifier: GPL-3.0-or-later
# Each target sets itself up below .venv with pip alone, and is a task of .ci/dev.py, which does the
# same without make. ARGS is handed on, for example
#   make test ARGS="tests/core -k gait"

# The Blender with a window that takes pictures of itself; options may follow it.
BLENDER ?= blender

.PHONY: help test lint demo bench referee test-farm test-window build release pictures diagram window experiment papers setups texts clean

help: ## list what can be made
	@sed -n 's/^\([a-z-]*\):.*## \(.*\)/make \1|\2/p' Makefile | awk -F'|' '{printf "%-15s %s\n", $$1, $$2}'

test: ## run the tests under Blender 5.2 and Blender 4.5
	@.ci/dev test $(ARGS)

lint: ## check style, types and layers
	@.ci/dev lint

demo: ## build an octopus that walks and one that swims, render both into build/demo
	@.ci/dev demo $(ARGS)

bench: ## measure speed, precision and memory against Blender's own inverse kinematics
	@.ci/dev bench $(ARGS)

referee: ## measure what Blender plays of set-ups, splices and drags, against their limits
	@.ci/dev referee $(ARGS)

test-farm: ## try the job scripts for render farms in Open Job Description, Flamenco and Slurm
	@.ci/dev test-farm $(ARGS)

test-window: ## live the first hour in a window by mouse and keys: BLENDER=/path/to/blender
	@BLENDER="$(BLENDER)" .ci/dev test-window $(ARGS)

build: ## make the extension's zip in dist with Blender's own packer, and validate it
	@.ci/dev build

release: ## make the zip, validate it, install it into a fresh Blender and take the first walk there
	@.ci/dev release

pictures: ## render the pictures of the documentation anew
	@.ci/dev pictures $(ARGS)

diagram: ## draw which package imports which anew, from the sources
	@.ci/dev diagram $(ARGS)

window: ## take the documentation's pictures of Blender's own window; needs a Blender with a window
	@BLENDER="$(BLENDER)" .ci/dev window $(ARGS)

experiment: ## splice a throw and a punch onto a walk at two timings and draw it; ARGS=FOLDER for clips of your own
	@.ci/dev experiment $(ARGS)

papers: ## make the papers' experiments and figures again in build/papers; ARGS=--quick to try it
	@.ci/dev papers $(ARGS)

setups: ## show every set-up on bumpy ground in build/setups; ARGS="--film --before" for videos, and without the body's life too
	@.ci/dev setups $(ARGS)

texts: ## print the texts that a language lacks, as a catalogue to fill in; ARGS=fr_FR
	@.ci/dev texts $(ARGS)

clean: ## delete what was built; delete .venv as well to set up anew
	@.ci/dev clean
