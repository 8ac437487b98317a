# make run        set everything up and serve the demo on HOST:PORT (127.0.0.1:8000)
# make test       set everything up and check it
# make test-all   with every case that takes minutes
# make soak       check it for longer

PYTHON ?= python3
BIN := .venv/bin
STAMP := .venv/installed
BROWSERS := chromium chromium-browser google-chrome

# Debian packages that are missing, as root or by sudo where it asks for no password: $(call debian,PACKAGE,WHAT FOR)
APT := $$([ "$$(id -u)" = 0 ] || echo sudo -n) env DEBIAN_FRONTEND=noninteractive apt-get
debian = { echo 'make: installing $(1) $(2)'; { $(APT) update -qq && $(APT) install -y -qq $(1); } >/dev/null 2>&1; } \
	|| { echo 'make: $(1) is missing $(2); install it: apt-get install $(1)' >&2; exit 1; }

.PHONY: run test test-all check soak install browser lock notebook image-check

run: install
	@exec $(BIN)/walk serve

# One process per core; the tests of a file share a server, so they stay together.
PYTEST := $(BIN)/pytest -n auto --maxprocesses 4 --dist loadfile --no-loadscope-reorder

test: check browser
	$(PYTEST)

test-all: check browser
	$(PYTEST) -m "exhaustive or not exhaustive"

check: install
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/pyright

# Every test, then an hour of random walks and pushes with every promise checked at every tick, and an hour of a server
# among hostile clients.
soak: test-all
	$(BIN)/python benchmarks/soak.py --robot talos --hours 0.5 --step-timing fixed
	$(BIN)/python benchmarks/soak.py --robot talos --hours 0.5 --push 0.33 --control-period 0.005
	$(BIN)/python benchmarks/soak.py --robot hrp2 --hours 0.5 --push 0.11
	$(BIN)/python benchmarks/soak.py --robot talos --hours 0.1 --body
	$(BIN)/python benchmarks/soak_server.py --minutes 60

install: $(STAMP)

# By pip, which is what a fresh machine has. All comes from the lock, the tools that install the project itself included.
$(STAMP): requirements.lock pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
		|| { echo 'make: Python 3.11 or newer is needed; name it: make PYTHON=...' >&2; exit 1; }
	@$(PYTHON) -c 'import ensurepip' 2>/dev/null || $(call debian,python3-venv,for the virtual environment)
	@$(PYTHON) -c 'import ctypes; ctypes.CDLL("libgomp.so.1")' 2>/dev/null || $(call debian,libgomp1,for Pinocchio)
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes -r requirements.lock
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation --editable .
	@touch $@

browser:
	@$(PYTHON) -c 'import ctypes; ctypes.CDLL("libatomic.so.1")' 2>/dev/null || $(call debian,libatomic1,for Playwright)
	@for name in $(BROWSERS); do command -v $$name >/dev/null && exit 0; done; $(call debian,chromium,for the tests of the page)

# One lock for everything; taken from it, what the container runs and what it is built with.
LOCK := $(BIN)/uv pip compile --universal --generate-hashes --python-version 3.11 --quiet
lock:
	$(LOCK) pyproject.toml --extra cluster --extra dev --output-file requirements.lock
	$(LOCK) pyproject.toml --extra cluster --constraint requirements.lock --output-file requirements-runtime.lock
	$(LOCK) --group build --constraint requirements.lock --output-file requirements-build.lock

# docs/client.ipynb with its outputs, from a server that runs at WALK_SERVER (http://localhost:8000).
notebook: install
	$(BIN)/uvx --with ipykernel --with httpx --with matplotlib --with msgpack --with numpy --with websockets \
		--from nbconvert jupyter-nbconvert --execute --to notebook --inplace docs/client.ipynb

# The Dockerfile, built and run where no container engine is: as root, with debootstrap and buildah.
image-check:
	sh deploy/check-image.sh
