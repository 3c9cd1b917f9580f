# The two commands of the README, and the chores. Everything runs in .venv, which each target makes.
PYTHON ?= python3
VENV   ?= .venv
BIN    := $(VENV)/bin
INSTALL := $(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint requirements.lock
# For tests machine code is made once here, and not by each of their processes. The demo makes what
# it needs, and says how far it is.
WARM := $(BIN)/python -m tests.kernels
# What pytest makes of the tests when it reads them for the first time, for the same reason.
READ_ONCE := $(BIN)/pytest --ignore tests/ros2 --collect-only -qq > /dev/null
SPREAD := --numprocesses 5 --dist loadfile --no-loadscope-reorder

.PHONY: demo test test-long test-all thorough test-ros2 test-ros2-short bench bench-campaign fuzz chaos docs lint format lock clean

demo: $(VENV)/.installed          ## run the main job: a campaign with moving doors, judged
	@$(BIN)/scenario demo
	@[ "$$(command -v scenario)" = "$(abspath $(BIN))/scenario" ] || \
		printf '\nThese lines can be typed after: . %s/activate\n' '$(BIN)'

test: $(VENV)/.installed-test     ## lint, types, import contracts, and all tests that are not long
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy --num-workers 2
	$(BIN)/lint-imports --no-cache
	$(BIN)/pytest --ignore tests/ros2 --ignore tests/long $(SPREAD)

test-long: $(VENV)/.installed-test $(VENV)/.installed-docs ## tutorials, examples, the site, a browser
	$(BIN)/pytest tests/long $(SPREAD)

test-all: test test-long test-ros2-short ## what every submission must pass

thorough: $(VENV)/.installed-test   ## every property with 500 examples instead of 25; hours
	$(BIN)/pytest --ignore tests/ros2 --numprocesses 2 --hypothesis-profile thorough

test-ros2: $(VENV)/.installed-test ## make ROS 2 environments (about 50 s each), test against them
	$(BIN)/python -m tests.ros2.environment jazzy kilted
	$(BIN)/pytest tests/ros2 --numprocesses logical --maxprocesses 4 --dist loadfile

test-ros2-short: $(VENV)/.installed-test ## the most important of these, with one distribution
	$(BIN)/python -m tests.ros2.environment kilted
	$(BIN)/pytest tests/ros2 -m short -k kilted --numprocesses logical --maxprocesses 4

bench: $(VENV)/.installed-test    ## measure, side by side; ends with goal / measured / met
	PYTHONDONTWRITEBYTECODE= $(BIN)/python -m tests.benchmarks

bench-campaign: $(VENV)/.installed-test ## the 120 runs of the published experiment, two at a time
	PYTHONDONTWRITEBYTECODE= $(BIN)/python -m tests.benchmarks campaign

fuzz: $(VENV)/.installed-test     ## 10 000 mutated files of every language; some hours
	$(BIN)/python -m tests.languages.fuzz

chaos: $(VENV)/.installed-test    ## kill, freeze, starve and cut off; half an hour beside other work
	$(BIN)/python -m tests.chaos

docs: $(VENV)/.installed-docs     ## build the documentation as a site: site/index.html
	$(BIN)/python -m tests.docs
	$(BIN)/sphinx-build --fail-on-warning --keep-going --nitpicky --quiet docs site

format: $(VENV)/.installed-test   ## rewrite sources the way lint wants them
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

lock:                             ## renew requirements.lock from pyproject.toml
	$(PYTHON) -m venv --clear $(VENV)-lock
	$(VENV)-lock/bin/python -m pip install --quiet --editable '.[test,docs]'
	$(VENV)-lock/bin/python -m pip freeze --exclude-editable > requirements.lock
	rm -rf $(VENV)-lock

clean:                            ## forget the virtual environment
	rm -rf $(VENV)

$(VENV)/.installed: pyproject.toml requirements.lock
	$(PYTHON) -m venv $(VENV)
	$(INSTALL) --editable .
	@touch $@

$(VENV)/.installed-docs: pyproject.toml requirements.lock
	$(PYTHON) -m venv $(VENV)
	$(INSTALL) --editable '.[docs]'
	@touch $@

$(VENV)/.installed-test: pyproject.toml requirements.lock
	$(PYTHON) -m venv $(VENV)
	$(INSTALL) --editable '.[test]'
	@$(READ_ONCE) & $(WARM) && wait
	@touch $@
