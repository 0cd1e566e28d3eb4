#!/bin/sh
# What tumble.def and Containerfile do inside of a bare Debian 12: packages, build in /src, install into /usr/local.
# Compiled for any machine of the kind: OPT="-O3 -march=native -fno-math-errno" for this one.
set -eu
export DEBIAN_FRONTEND=noninteractive
OPT="${OPT:--O3 -fno-math-errno}"
apt-get update
apt-get install -y --no-install-recommends ca-certificates make
cd /src
tools/setup
make clean
make SETUP=true OPT="$OPT"
make install SETUP=true OPT="$OPT" PREFIX=/usr/local
rm -rf /src/build /var/lib/apt/lists/*
tumble -version
