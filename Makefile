# tumble: 'make help' lists the targets. Everything is built in build/ (SANITIZE=1: build-asan/).
#   OPT="-O2 -g"  optimisation      V=1        show the commands       SANITIZE=1  address and undefined-behaviour sanitizers
#   PETSC_DIR= PETSC_ARCH=          a PETSc that pkg-config does not know
#   MPIEXEC=  CC=  PYTHON=          other programs                     SETUP=true  never install missing packages
VERSION := 0.2.0
PREFIX  ?= /usr/local
OPT     ?= -O3 -march=native -fno-math-errno
SETUP   ?= tools/setup
PYTHON  ?= $(firstword $(wildcard /usr/bin/python3) python3)
ifeq ($(origin CC),default)
  CC := mpicc
endif
ifdef SANITIZE
  BUILD := build-asan
  OPT   := -O1 -fno-omit-frame-pointer -fsanitize=address,undefined
else
  BUILD := build
endif
V ?= 0
Q := $(if $(filter-out 0,$(V)),,@)
MAKEFLAGS += --no-print-directory

export OMPI_ALLOW_RUN_AS_ROOT := 1
export OMPI_ALLOW_RUN_AS_ROOT_CONFIRM := 1
export OMP_NUM_THREADS ?= 1
export ASAN_OPTIONS ?= detect_leaks=0:verify_asan_link_order=0

# Questions to other programs are asked when first needed and once (so that 'make deps' works without pkg-config and MPI).
once        = $(eval $1 := $(shell $2))$($1)
PKG         = PKG_CONFIG_PATH=$(if $(PETSC_DIR),$(PETSC_DIR)/$(PETSC_ARCH)/lib/pkgconfig:$(PETSC_DIR)/lib/pkgconfig:)$$PKG_CONFIG_PATH pkg-config
HAVE_PETSC  = $(if $(and $(PETSC_DIR),$(if $(wildcard $(PETSC_DIR)/$(PETSC_ARCH)/lib/pkgconfig/petsc.pc $(PETSC_DIR)/lib/pkgconfig/petsc.pc),,no)),$(error there is no PETSc in PETSC_DIR=$(PETSC_DIR)$(if $(PETSC_ARCH), PETSC_ARCH=$(PETSC_ARCH)): no lib/pkgconfig/petsc.pc; correct it, or leave it out for the PETSc that pkg-config knows))$(or $(call once,PETSC_VERSION,$(PKG) --modversion petsc),$(error pkg-config finds no PETSc: run 'make deps', or give PETSC_DIR and PETSC_ARCH))
PETSC_FLAGS = $(if $(HAVE_PETSC),$(call once,PETSC_FLAGS,$(PKG) --cflags petsc; $(PKG) --cflags hdf5-openmpi 2> /dev/null))
PETSC_LIBS  = $(call once,PETSC_LIBS,$(PKG) --libs petsc; $(PKG) --libs hdf5-openmpi 2> /dev/null)
PETSC_RPATH = $(if $(PETSC_DIR),$(call once,PETSC_RPATH,echo -Wl$(,)-rpath$(,)$$($(PKG) --variable=libdir petsc)))
CMOCKA      = $(call once,CMOCKA,$(PKG) --cflags --libs cmocka)
MPIEXEC    ?= $(call once,MPIEXEC,mpiexec --version | grep -qE 'Open MPI|OpenRTE' && echo mpiexec --oversubscribe --bind-to none || echo mpiexec)
, := ,

# CUDA, where PETSC_DIR's PETSc has it: the kernels of src/device are compiled a second time, for the GPU.
PETSC_CONF  = $(firstword $(wildcard $(PETSC_DIR)/$(PETSC_ARCH)/lib/petsc/conf/petscvariables $(PETSC_DIR)/lib/petsc/conf/petscvariables))
conf        = $(shell sed -n 's/^$1 = *//p' $(PETSC_CONF))
NVCC       := $(if $(PETSC_DIR),$(if $(PETSC_CONF),$(call conf,CUDAC)))
CUDA_LIBS  := $(if $(NVCC),$(filter -L% -Wl%,$(call conf,CUDA_LIB)) -lcudart)
CUDA_FLAGS := $(if $(NVCC),$(filter-out -std=% -O%,$(call conf,CUDAC_FLAGS)))
CUDA        = $(NVCC) -x cu -std=c++17 -O3 -lineinfo $(CUDA_FLAGS) -Iinclude -c

COMPILE = $(CC) -std=gnu11 -g $(OPT) -Wall -Wextra -fPIC -MMD -MP -Iinclude -I$(BUILD) $(PETSC_FLAGS) $(if $(NVCC),-DTUMBLE_CUDA) $(CFLAGS)
LIBS    = $(PETSC_LIBS) $(PETSC_RPATH) $(if $(NVCC),$(CUDA_LIBS) -lstdc++) -lmetis -lyaml -lmuparser -ldl -lm $(LDFLAGS)
# That nothing is missing in the libraries below libtumble is seen where the program is linked: of a test's link it is three quarters of the time.
TUMBLE  = -L$(BUILD) -ltumble -Wl,-rpath,'$$ORIGIN/..:$$ORIGIN/../..:$$ORIGIN/../../..' -Wl,--allow-shlib-undefined
# Test programs spend their time in the library; OPT from outside stays.
LIGHT   = $(if $(filter file,$(origin OPT)),-O1 -g1)
ENTER   = $(Q)$(if $(Q),printf '  %-5s %s\n' $1 $@; )mkdir -p $(@D) &&

OBJECTS := $(patsubst src/%.c,$(BUILD)/obj/%.o,$(filter-out src/run/main.c,$(wildcard src/*/*.c src/*/*/*.c)))
KERNELS := $(if $(NVCC),$(patsubst src/%.c,$(BUILD)/cuda/%.o,$(wildcard src/device/*.c)))
SHAPES  := $(patsubst shapes/%.c,$(BUILD)/shapes/%.so,$(wildcard shapes/*.c))
TESTS   := $(patsubst tests/%.c,$(BUILD)/tests/%,$(wildcard tests/*/*.c)) $(patsubst tests/%.c,$(BUILD)/tests/%.so,$(wildcard tests/shape/badshapes/*.c tests/runs/faults/*.c))
SOURCES := $(wildcard src/*/*.[ch] src/*/*/*.[ch] include/*.h include/*/*.h shapes/*.c tests/*.h tests/*/*.[ch] tests/shape/badshapes/*.c tests/runs/faults/*.c tools/*.c)
SCRIPTS  = $(shell grep -slE '^\#!.*python3' tools/*) $(wildcard tools/*.py tools/*/*.py tests/*.py tests/*/*.py)

.DEFAULT_GOAL := all
.DELETE_ON_ERROR:
.PHONY: all tests shapes demo gallery bench scaling extremes fuzz faults mutate validate check check-64 check-unit check-e2e check-gpu demo-now check-now check-unit-now check-e2e-now style format test-shape options install deps clean help FORCE

all: $(BUILD)/tumble shapes ## build the program and the shapes (default)
shapes: $(SHAPES)           ## build the shape plugins only
tests: all $(TESTS)

# Files that are rewritten only when their content changes: what they hold decides what is built anew.
rewrite = $(Q)mkdir -p $(@D) && { $1; } > $@.$$$$ && if cmp -s $@ $@.$$$$; then rm $@.$$$$; else mv $@.$$$$ $@; fi
COMMIT  = $$(git rev-parse --short=12 HEAD 2> /dev/null || echo unknown)$$(git status --porcelain -uno 2> /dev/null | grep -q . && echo -dirty)
$(BUILD)/version.h: FORCE
	$(call rewrite,printf '#define TUMBLE_COMMIT "%s"\n#define TUMBLE_VERSION "$(VERSION)"\n' "$(COMMIT)")
$(BUILD)/flags: FORCE
	$(call rewrite,echo $(call quote,$(COMPILE) $(LIBS)))
quote = '$(subst ','\'',$1)'

$(BUILD)/obj/%.o: src/%.c $(BUILD)/flags | $(BUILD)/version.h
	$(call ENTER,CC) $(COMPILE) -c -o $@ $<
$(BUILD)/cuda/%.o: src/%.c $(BUILD)/flags
	$(call ENTER,CUDA) $(CUDA) -MMD -MP -MF $(@:.o=.d) -o $@ $<
$(BUILD)/libtumble.so: $(OBJECTS) $(KERNELS)
	$(call ENTER,LINK) $(CC) $(OPT) -shared -Wl,-soname,libtumble.so -o $@ $^ $(LIBS)
$(BUILD)/tumble: $(BUILD)/obj/run/main.o $(BUILD)/libtumble.so
	$(call ENTER,LINK) $(CC) $(OPT) -o $@ $< -L$(BUILD) -ltumble -Wl,-rpath,'$$ORIGIN',-rpath,'$$ORIGIN/../lib/tumble' $(LIBS)
PLUGIN = $(call ENTER,SHAPE) $(COMPILE) -MF $(@:.so=.d) -shared -o $@ $< $(TUMBLE) $(LIBS)
$(BUILD)/shapes/%.so: shapes/%.c $(BUILD)/flags | $(BUILD)/libtumble.so
	$(PLUGIN)
$(BUILD)/tests/shape/badshapes/%.so: tests/shape/badshapes/%.c $(BUILD)/flags | $(BUILD)/libtumble.so
	$(PLUGIN)
$(BUILD)/tests/runs/faults/%.so: tests/runs/faults/%.c $(BUILD)/flags # preloaded: links to nothing of ours
	$(call ENTER,TEST) $(COMPILE) -MF $(@:.so=.d) -shared -o $@ $< -ldl
$(BUILD)/tests/%: tests/%.c $(BUILD)/flags | $(BUILD)/libtumble.so $(BUILD)/version.h
	$(call ENTER,TEST) $(COMPILE) $(LIGHT) -Itests -Isrc/$(*D) -MF $@.d -o $@ $< $(TUMBLE) $(CMOCKA) $(LIBS)
-include $(wildcard $(BUILD)/*/*.d $(BUILD)/*/*/*.d $(BUILD)/*/*/*/*.d)

# Installing comes before a fresh make, which then finds what was installed.
demo:       ## run a settling disc on the cores that are free (RANKS=) and draw pictures (installs what is missing; ARGS= for the program)
check:      ## build and run all tests (installs what is missing; ARGS= for pytest, such as ARGS="-k mesh")
check-unit: ## unit tests only
check-e2e:  ## end-to-end tests only
demo check check-unit check-e2e:
	@$(SETUP)
	@$(MAKE) $@-now
# Ranks that wait spin: where others use the cores, one rank is faster than two.
RANKS = $(or $(shell $(PYTHON) tools/free-cores 2 2> /dev/null),1)
demo-now: all
	$(MPIEXEC) -n $(RANKS) $(BUILD)/tumble runs/sedimentation.yaml -output_every 2 -output_overwrite $(ARGS)
	$(PYTHON) tools/plot out/sedimentation
	$(PYTHON) tools/animate out/sedimentation --width 400
	@echo "Pictures and a film:" && ls -1 out/sedimentation/*.png out/sedimentation/animation.*
check-now check-unit-now check-e2e-now: tests
	@TUMBLE_BUILD=$(BUILD) MPIEXEC="$(MPIEXEC)" $(PYTHON) -m pytest $(WORKERS) $(CHECK_$(@:check-%-now=%)) $(ARGS)
# Half as many tests again at a time as cores are free, since starting a run is mostly waiting; if pytest-xdist is there.
WORKERS = $(shell $(PYTHON) -c 'import xdist' 2> /dev/null && n=$$($(PYTHON) tools/free-cores 8) && printf "%s " -n $$((n + n / 2)) --dist loadgroup)
CHECK_unit = $(wildcard tests/*/test_*.c)
CHECK_e2e  = $(wildcard tests/*/test_*.py)
# A PETSc with 64-bit numbers: Debian's libpetsc64-real-dev, or PETSC64=PETSC_DIR/PETSC_ARCH. What CHECK_64 selects of the unit tests, a short fall.
PETSC64  ?= $(firstword $(wildcard /usr/lib/petscdir/petsc64*/*-real))
CHECK_64 ?= numbers or refined or partition or constraint or blockgs or sharing or system or state
IN_64     = BUILD=build-64 PETSC_DIR=$(patsubst %/,%,$(dir $(PETSC64))) PETSC_ARCH=$(notdir $(PETSC64))
check-64: ## build in build-64/ with a PETSc of 64-bit numbers, tests of numbers and solvers, a short fall on two ranks (Debian: libpetsc64-real-dev; PETSC64=dir/arch)
	$(if $(PETSC64),,$(error no PETSc with 64-bit numbers: apt-get install libpetsc64-real-dev, or give PETSC64=PETSC_DIR/PETSC_ARCH))
	@$(MAKE) $(IN_64) check-unit-now ARGS="-k '$(CHECK_64)'"
	$(MPIEXEC) -n 2 build-64/tumble runs/sedimentation.yaml -sim_time 0.02 -output_dir out/check-64 -output_overwrite
check-gpu: tests ## the list of scenes of tests/runs/test_device.py on a GPU beside the processor (a build with a PETSc that has CUDA: tools/petsc-current --cuda)
	@TUMBLE_BUILD=$(BUILD) MPIEXEC="$(MPIEXEC)" TUMBLE_DEVICE=cuda timeout $(or $(LIMIT),240) $(PYTHON) -m pytest tests/runs/test_device.py $(ARGS)
test-shape: all $(BUILD)/tests/shape/conformance ## conformance suite on one plugin: SHAPE=path/to/x.so
	$(if $(SHAPE),,$(error give the plugin: make test-shape SHAPE=path/to/x.so))
	$(BUILD)/tests/shape/conformance $(SHAPE) $(ARGS)
bench: all ## benchmarks, appended to runs/bench/results.csv (ARGS="--quick", ARGS="--only cavity --cells 55225 --ranks 1"; 'tools/bench --help')
	$(PYTHON) tools/bench $(ARGS)
validate: all ## long comparisons of the scenes with their references, one table (ARGS="cylinder-2d1", ARGS="--longest 2"; 'tools/validate --help')
	$(if $(ARGS),$(PYTHON) tools/validate $(ARGS),all=0; $(PYTHON) tools/validate --store || all=1; \
	$(PYTHON) tools/validate --presets --table runs/validate/presets.csv || all=1; $(PYTHON) tools/validate --ledger || all=1; exit $$all)
gallery: ## one page of all scenes with picture, cost and verdict: out/gallery.html
	$(PYTHON) tools/gallery $(ARGS)
scaling: all ## strong and weak scaling on 1 and 2 ranks: tables, plots, model (ARGS="--ranks 1,2,4"; runs/bench/scaling.slurm for clusters)
	$(PYTHON) tools/scaling $(ARGS)
extremes: all ## the stability map: runs/extremes/map.csv, map.png (ARGS=--quick)
	$(PYTHON) tools/extremes $(ARGS)
fuzz: all ## random scenes, each of which ends well or with one message: runs/fuzz (ARGS="--seeds 1-20"; 'tools/fuzz --help')
	$(PYTHON) tools/fuzz $(ARGS)
faults: all $(BUILD)/tests/runs/faults/inject.so ## injected faults, each of which ends with one message and loses no checkpoint: runs/faults (ARGS=--quick; 'tools/faults --help')
	$(PYTHON) tools/faults $(ARGS)
mutate: all tests ## do the tests see mistakes? tests/mutations.toml, one at a time in a copy (ARGS="--only NAME"; 'tools/mutate --help')
	$(PYTHON) tools/mutate $(ARGS)
style: ## rooms, text, formatting, scripts that compile
	tools/check-layers
	tools/check-text --wide
	PYTHONPYCACHEPREFIX=$(BUILD)/pycache $(PYTHON) -m py_compile $(SCRIPTS)
	@if command -v clang-format > /dev/null; then clang-format --dry-run -Werror $(SOURCES); else echo "clang-format is not installed: formatting is not checked"; fi
format: ## apply clang-format to all C files
	clang-format -i $(SOURCES)
options: all ## write runs/reference/ (OPTIONS.md, OUTPUT.md, scene.schema.json) anew from the tables of options (src/*/options.c) and columns (src/report)
	$(BUILD)/tumble -help markdown > runs/reference/OPTIONS.md
	$(BUILD)/tumble -help output > runs/reference/OUTPUT.md
	$(BUILD)/tumble -help schema > runs/reference/scene.schema.json
# As tumble-plot and so on; 'import tumble' finds the package with PYTHONPATH=PREFIX/share/tumble/python
INSTALLED := plot animate report
$(BUILD)/tumble.1: $(BUILD)/tumble $(SHAPES)
	$(call ENTER,MAN) $(BUILD)/tumble -help man > $@
install: all $(BUILD)/tests/shape/conformance $(BUILD)/tumble.pc $(BUILD)/tumble.1 ## install program, library, header of shapes, shapes, tools, manual page, pkg-config file into PREFIX (default /usr/local; DESTDIR= for packages)
	install -d $(addprefix $(DESTDIR)$(PREFIX)/,bin lib/pkgconfig lib/tumble/shapes lib/tumble/tests include/tumble share/man/man1 share/tumble/runs share/tumble/python/tumble)
	install $(BUILD)/tumble $(DESTDIR)$(PREFIX)/bin
	install -m 644 $(BUILD)/libtumble.so $(DESTDIR)$(PREFIX)/lib/tumble
	install -m 644 $(SHAPES) $(DESTDIR)$(PREFIX)/lib/tumble/shapes
	install $(BUILD)/tests/shape/conformance $(DESTDIR)$(PREFIX)/lib/tumble/tests
	ln -sf ../lib/tumble/tests/conformance $(DESTDIR)$(PREFIX)/bin/tumble-test-shape
	install -m 644 include/shape.h include/compat.h $(DESTDIR)$(PREFIX)/include/tumble
	install -m 644 $(BUILD)/tumble.1 $(DESTDIR)$(PREFIX)/share/man/man1
	install -m 644 $(BUILD)/tumble.pc $(DESTDIR)$(PREFIX)/lib/pkgconfig
	cp -R runs/. $(DESTDIR)$(PREFIX)/share/tumble/runs
	install $(addprefix tools/,$(INSTALLED)) $(DESTDIR)$(PREFIX)/share/tumble/python
	install -m 644 tools/pyproject.toml $(DESTDIR)$(PREFIX)/share/tumble/python
	install -m 644 tools/tumble/*.py $(DESTDIR)$(PREFIX)/share/tumble/python/tumble
	for tool in $(INSTALLED); do ln -sf ../share/tumble/python/$$tool $(DESTDIR)$(PREFIX)/bin/tumble-$$tool; done
# A plugin must see the PETSc and MPI that the library was built with: their flags are written out.
MPI_FLAGS = $(call once,MPI_FLAGS,$(CC) --showme:compile 2> /dev/null || $(CC) -compile_info 2> /dev/null | tr ' ' '\n' | grep '^-I' | tr '\n' ' ')
$(BUILD)/tumble.pc: FORCE
	$(call rewrite,printf '%s\n' 'prefix=$(PREFIX)' 'libdir=$${prefix}/lib/tumble' 'includedir=$${prefix}/include/tumble' 'shapesdir=$${libdir}/shapes' \
	  'scenesdir=$${prefix}/share/tumble/runs' 'pythondir=$${prefix}/share/tumble/python' '' 'Name: tumble' 'Description: Rigid bodies in a viscous fluid: shape plugins and the solver library' 'Version: $(VERSION)' \
	  'Cflags: -I$${includedir} $(strip $(filter -I%,$(PETSC_FLAGS)) $(filter-out $(PETSC_FLAGS),$(MPI_FLAGS)))' 'Libs: -L$${libdir} -ltumble -Wl$(,)-rpath$(,)$${libdir} $(strip $(PETSC_LIBS) $(PETSC_RPATH))')
deps: ## install missing Debian packages
	tools/setup
clean: ## remove what was built
	rm -rf build build-asan build-64
help: ## this list
	@sed -nE 's/^([a-z0-9-]+):.*## (.*)/  \1|\2/p' Makefile | awk -F'|' '{printf "%-14s %s\n", $$1, $$2}'
	@sed -n '2,4s/^# *//p' Makefile
