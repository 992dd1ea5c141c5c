# SPDX-License-Identifier: GPL-3.0-or-later
# Each target sets itself up below .venv with pip alone; see .ci/venv. ARGS is handed on, for example
#   make test ARGS="tests/core -k gait"

# Blender as a Python module: 5.2 where Python 3.13 is there, else 4.5 with Python 3.11.
WITH_BPY = python=$$(.ci/venv bpy-5.2 bpy-4.5) && export PYTHONPATH=. &&
WITH_LINT = python=$$(.ci/venv lint) && bin=$${python%/*} &&

# The Blender with a window that takes pictures of itself; options may follow it.
BLENDER ?= blender

.PHONY: help test lint demo bench referee build pictures diagram window experiment setups clean

help: ## list what can be made
	@sed -n 's/^\([a-z]*\):.*## \(.*\)/make \1|\2/p' Makefile | awk -F'|' '{printf "%-14s %s\n", $$1, $$2}'

test: ## run the tests under Blender 5.2 and Blender 4.5
	@.ci/test $(ARGS)

lint: ## check style, types and layers
	@$(WITH_LINT) $$bin/ruff check
	@$(WITH_LINT) $$bin/ruff format --check
	@$(WITH_LINT) $$bin/pyright --pythonpath $$python
	@$(WITH_LINT) $$bin/lint-imports --no-cache --no-logo

demo: ## build an octopus that walks and one that swims, render both into build/demo
	@$(WITH_BPY) $$python .ci/check_rendering.py && $$python docs/studio/demo.py $(ARGS)

bench: ## measure speed, precision and memory against Blender's own inverse kinematics
	@$(WITH_BPY) $$python -m tests.bench $(ARGS)

referee: ## measure what Blender plays of set-ups, splices and drags, against their limits
	@$(WITH_BPY) $$python -m tests.referee $(ARGS)

build: ## make the extension's zip in dist with Blender's own packer, and validate it
	@$(WITH_BPY) $$python .ci/build.py

pictures: ## render the pictures of the documentation anew
	@$(WITH_BPY) $$python .ci/check_rendering.py && $$python docs/studio/pictures.py $(ARGS)

diagram: ## draw which package imports which anew, from the sources
	@$(WITH_LINT) $$python docs/studio/packages.py $(ARGS)

window: ## take the documentation's pictures of Blender's own window; needs a Blender with a window
	@BLENDER="$(BLENDER)" .ci/window $(ARGS)

experiment: ## splice a throw and a punch onto a walk at two timings and draw it; ARGS=FOLDER for clips of your own
	@$(WITH_BPY) $$python .ci/check_rendering.py && $$python docs/studio/experiment.py $(ARGS)

setups: ## show every set-up on bumpy ground in build/setups; ARGS=--film for videos too
	@$(WITH_BPY) $$python .ci/check_rendering.py && $$python docs/studio/setups.py $(ARGS)

clean: ## delete what was built; delete .venv as well to set up anew
	rm -rf build dist .ruff_cache .import_linter_cache
	find octo_motion tests docs -name __pycache__ -type d -prune -exec rm -rf {} +
