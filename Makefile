PYTHON ?= python3
VENV ?= .venv
RUN = $(VENV)/bin

.PHONY: install demo test nightly quick lint types docs bench clean

install: $(VENV)/installed

$(VENV)/installed: pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(RUN)/python -m pip install --quiet --no-compile --editable '.[test]'
	touch $@

demo: install
	mkdir -p demo
	$(RUN)/glider-stream build seed-box -o demo/paper.h5
	$(RUN)/glider-stream query demo/paper.h5 -o demo/paper.json
	$(RUN)/glider-stream build seed-box --set steering.method=flow-map --set neighbours.kind=all -o demo/exact.h5
	$(RUN)/glider-stream query demo/exact.h5 -o demo/exact.json
	$(RUN)/glider-stream plot demo/exact.h5 demo/paper.json demo/exact.json -o demo/routes.png
	@echo "paper: the control line with 16 controls, to the 27 nearest nodes, as in the paper."
	@echo "exact: the flow map, to all nodes. Look at demo/routes.png: both routes, with their times."

test: install
	$(RUN)/python -m pytest -n 2 --dist worksteal -m "not wide"

nightly: install
	$(RUN)/python -m pytest -n 2 --dist worksteal

quick: install
	$(RUN)/python -m pytest -m "not slow and not wide"

lint: install
	$(RUN)/python -m ruff check .
	$(RUN)/python -m ruff format --check .

types: install
	$(RUN)/python -m mypy

docs: install
	$(RUN)/python -m mkdocs build --strict

bench: install
	$(RUN)/glider-stream bench --against benchmarks/records/bench.json

clean:
	rm -rf $(VENV) demo site build *.egg-info
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
