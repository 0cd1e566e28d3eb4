#!/bin/sh
# PETSc of conda-forge lies in $PREFIX; compiled for any machine of the kind.
set -eu
make SETUP=true CC=mpicc PETSC_DIR="$PREFIX" PETSC_ARCH= OPT="-O3 -fno-math-errno"
make install SETUP=true CC=mpicc PETSC_DIR="$PREFIX" PETSC_ARCH= OPT="-O3 -fno-math-errno" PREFIX="$PREFIX"
