PYTHON ?= python3
VENV ?= .venv
RUN = $(VENV)/bin

.PHONY: install demo test bench clean

install: $(VENV)/installed

$(VENV)/installed: pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(RUN)/python -m pip install --quiet --editable '.[test]'
	touch $@

demo: install
	mkdir -p demo
	$(RUN)/glider-stream build seed-box -o demo/seed-box.h5
	$(RUN)/glider-stream query demo/seed-box.h5 -o demo/path.json
	$(RUN)/glider-stream plot demo/seed-box.h5 demo/path.json -o demo/route.png
	$(RUN)/glider-stream plot demo/seed-box.h5 -o demo/roadmap.png
	@echo "The roadmap is demo/seed-box.h5, the route demo/path.json; look at demo/route.png and demo/roadmap.png"

test: install
	$(RUN)/python -m pytest -n 2 --dist worksteal

bench: install
	$(RUN)/glider-stream bench --against benchmarks/records/bench.json

clean:
	rm -rf $(VENV) demo build *.egg-info
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
