#!/bin/bash
# Compiles the kernels of src/device for the GPU of this machine (some 30 s on four cores), compares them with themselves on the processor, and times them:
# runs/bench/kernels.sh [folder for the program]. Needs nvcc (NVCC=, else that of the path or of /usr/local/cuda) and a C compiler, no PETSc. CUDA_ARCH=90.
set -e
root=$(cd "$(dirname "$0")/../.." && pwd)
to=${1:-$root/build/kernels}
nvcc=${NVCC:-$(command -v nvcc || echo /usr/local/cuda/bin/nvcc)}
mkdir -p "$to"
if [ ! -x "$to/kernels" ]; then
  for file in "$root"/src/device/*.c; do
    name=$(basename "$file" .c)
    "$nvcc" -x cu -std=c++17 -O3 -arch=sm_"${CUDA_ARCH:-90}" -I"$root/include" -c "$file" -o "$to/$name.cuda.o" &
    gcc -std=gnu11 -O3 -march=haswell -DTUMBLE_CUDA -I"$root/include" -c "$file" -o "$to/$name.cpu.o" &
  done
  gcc -std=gnu11 -O2 -I"$root/include" -c "$root/runs/bench/kernels.c" -o "$to/kernels.o" &
  for job in $(jobs -p); do wait "$job"; done
  "$nvcc" -arch=sm_"${CUDA_ARCH:-90}" -cudart static -o "$to/kernels" "$to"/*.o -lm
fi
if [ -n "$ONLY_COMPILE" ]; then exit; fi
"$to/kernels" cuda 8
for n in ${SIZES:-64 128}; do "$to/kernels" cuda "$n" 20; done
