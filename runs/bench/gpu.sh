#!/bin/bash
# The step on one GPU beside all cores of the machine, lid-driven cube, same options in time: runs/bench/gpu.sh [build folder]. Needs a build with a
# PETSc that has CUDA (tools/petsc-current --cuda, then make PETSC_DIR=... PETSC_ARCH=cuda). SIZES="32 64", RANKS=16, STEPS=5, PRESETS="balanced fast".
set -e
cd "$(dirname "$0")/../.."
build=${1:-build}
ranks=${RANKS:-$(nproc)}
out=$(mktemp -d)
trap 'rm -rf "$out"' EXIT

# time NAME RANKS option...: seconds a step without the first two, outer iterations, kinetic energy at the end
measure() {
  local name=$1 n=$2
  shift 2
  mpiexec --bind-to core -n "$n" "$build/tumble" runs/bench/cavity-3d.yaml "$@" -output_dir "$out/$name" -output_overwrite -output_every 0 > "$out/$name.log" 2>&1 ||
    { echo "| $name | failed: $(grep -m1 error "$out/$name.log") | | |"; return; }
  awk -F, -v name="$name" 'NR == 1 { for (i = 1; i <= NF; i++) at[$i] = i }
    NR > 1 { n++; energy = $at["kinetic_energy"]; if (n > 2) { s += $at["seconds_nse"]; it += $at["outer_iterations"]; m++ } }
    END { printf "| %s | %.4f | %.2f | %s |\n", name, s / m, it / m, energy }' "$out/$name/series.csv"
}

echo "| run | s a step | outer iterations | kinetic energy |"
echo "| --- | --- | --- | --- |"
for preset in ${PRESETS:-balanced fast}; do
  for n in ${SIZES:-32 64}; do
    scene="-mesh_cells $n,$n,$n -preset $preset -sim_dt 5e-3 -sim_steps ${STEPS:-5}"
    measure "$preset-$n-gpu" 1 $scene -device cuda
    measure "$preset-$n-$ranks-cores" "$ranks" $scene
  done
done
