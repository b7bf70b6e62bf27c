# A fresh machine needs git, make, Python 3.10 to 3.13, and a C and C++ compiler. No ROS.
#
#   PYTHON=/path/to/python3.12   the interpreter to use, when the environment is made
#   LUPIN_ROS=kilted             the wheels of ROS 2 Kilted, in .venv-kilted; otherwise those of Jazzy, in .venv
#   ARGS="..."                   further arguments, for run, check, test and mutants

.DEFAULT_GOAL := help
.PHONY: help run check test test-all test-kilted audit mutants soak faults matrix docs environment environment-dev clean

# Paths stay relative, so that a checkout may lie in a folder with blanks in its name.
VENV = .venv$(addprefix -,$(filter-out jazzy,$(LUPIN_ROS)))
VENV_PYTHON = $(VENV)/bin/python
export PYTHON LUPIN_ROS
test-kilted: LUPIN_ROS = kilted

help:
	@echo "make run     run the inspection mission in the simulated greenhouse, the robot ten times as fast"
	@echo "             (ARGS=\"--speed 1 --tags 1,5,12\" to run it another way)"
	@echo "make check   the linter, the type checker, and the quick tests that need no ROS (ARGS=\"...\" for pytest)"
	@echo "make test    the same, the slower tests, and the core of those over ROS 2 and in a browser"
	@echo "make test-all  all tests, the long ones too, and test-kilted: before an issue is closed"
	@echo "make test-kilted  all that is over ROS 2 or in a browser, on ROS 2 Kilted"
	@echo "make audit   whether something is known against the installed packages, or one was changed"
	@echo "make mutants how many small changes to the code the tests notice (ARGS=\"machine sim\" for some rooms only)"
	@echo "make soak    real nodes for HOURS=2, mission after mission: what they hold, into the folder soak"
	@echo "make faults  real nodes, a run with faults for each of SEEDS=1-20: the table, and runs.csv in the folder faults"
	@echo "make matrix  every source of motion with every stop, by real nodes: what moved, into the folder matrix"
	@echo "             (ARGS=\"--source cmd_vel --stop stop_a\" for some, --defects plants some and looks for them)"
	@echo "make docs    prove the shipped missions, and build the documentation as a site: open site/index.html"
	@echo "make clean   remove .venv, .venv-kilted and all caches of this checkout"
	@echo "The first run prepares .venv, the first test adds to it; that takes a few minutes, later ones start at once."

# What a run needs, and that with all that tests and documentation need. Both are the same .venv.
environment environment-dev:
	@command -v python3 >/dev/null || { echo "python3 is missing. On Debian and Ubuntu: sudo apt install python3 python3-venv python3-dev" >&2; exit 1; }
	@python3 tools/bootstrap.py $(if $(findstring dev,$@),dev,run)

# All 29 tags take four minutes at the robot's own speed; a first look should not.
run: environment
	@$(VENV)/bin/lupin run inspection $(or $(ARGS),--speed 10)

# Tests start hundreds of processes: modules compiled anew in each of them would double their time.
check test test-all test-kilted: export PYTHONDONTWRITEBYTECODE =

# Through the environment module, which completes the library path where ROS 2 came from apt.
check test test-all test-kilted: environment-dev
	@$(VENV_PYTHON) -m lupin_ros.adapter.environment $(VENV_PYTHON) tools/suite.py $@ $(ARGS)
	@$(if $(filter test-all,$@),$(MAKE) test-kilted)

audit: environment-dev
	@$(VENV_PYTHON) tools/audit.py

mutants: environment-dev
	@$(VENV_PYTHON) -m pip install --quiet --editable '.[mutation]'
	@$(VENV_PYTHON) tools/mutants.py $(ARGS)

soak: environment-dev
	@$(VENV_PYTHON) -m lupin_ros.adapter.environment $(VENV_PYTHON) benchmarks/soak.py --hours $(or $(HOURS),2) $(ARGS)

faults: environment-dev
	@$(VENV_PYTHON) -m lupin_ros.adapter.environment $(VENV_PYTHON) -m tests.faults.campaign --seeds $(or $(SEEDS),1-20) $(ARGS)

matrix: environment-dev
	@$(VENV_PYTHON) -m lupin_ros.adapter.environment $(VENV_PYTHON) -m tests.lupin_ros.system.safety.matrix.run $(ARGS)

# The pages for authors are brought up to date first: what they show is what the commands print.
docs: environment-dev
	@$(VENV_PYTHON) tools/pages.py
	@NO_MKDOCS_2_WARNING=1 $(VENV_PYTHON) -m mkdocs build
	@echo "open site/index.html"

clean:
	rm -rf .venv .venv-kilted .mypy_cache .pytest_cache .ruff_cache .hypothesis htmlcov .coverage
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
