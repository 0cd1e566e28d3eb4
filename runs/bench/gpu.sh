#!/bin/bash
# A step on one GPU beside all cores of the machine, lid-driven cube, same options in time; numbers of both; bytes on the device an unknown and over
# the bus in a step; then the table of kernels: runs/bench/gpu.sh [build folder]. Within LIMIT seconds (220): rows that would begin later are left out.
# Needs a build with a PETSc that has CUDA (tools/petsc-current --cuda, then make tests PETSC_DIR=... PETSC_ARCH=cuda), and before that
# ONLY_COMPILE=1 runs/bench/kernels.sh for the kernels. SIZES="64 128", RANKS=16, STEPS=5, PRESETS="balanced fast", CHECK=1: first the list of scenes of
# make check-gpu. SPHERES="64 128": edges in cells of cubes with spheres of ten cells, one every 12.8 cells (1,000 in 128^3), under a penalty, with
# `balanced`, beside the same step without them (issue: at most 2.5 times). DEVICE=emulate: on the processor, to try this script.
set -e
cd "$(dirname "$0")/../.."
build=${1:-build}
device=${DEVICE:-cuda}
ranks=${RANKS:-$(nproc)}
limit=${LIMIT:-220}
out=$(mktemp -d)
trap 'rm -rf "$out"' EXIT

# memory in use on the GPU in bytes, 0 without one
in_use() {
  nvidia-smi --query-gpu=memory.used --format=csv,noheader,nounits 2> /dev/null | awk '{ print $1 * 1048576; exit }' | grep . || echo 0
}

# most of it while process $1 lives, into file $2
watch_memory() {
  local most=0 now
  while kill -0 "$1" 2> /dev/null; do
    now=$(in_use)
    if [ "$now" -gt "$most" ]; then most=$now; fi
    echo "$most" > "$2"
    sleep 0.2
  done
}

# measure NAME RANKS option...: a row of the table, of steps from the third on
measure() {
  local name=$1 n=$2 before left
  shift 2
  left=$((limit - SECONDS))
  if [ "$left" -lt 15 ]; then
    echo "| $name | no time left | | | | |"
    return
  fi
  before=$(in_use)
  echo 0 > "$out/$name.memory"
  timeout "$left" mpiexec --bind-to core -n "$n" "$build/tumble" runs/bench/cavity-3d.yaml "$@" -output_dir "$out/$name" -output_overwrite -output_every 0 \
    -info "$out/$name.info:sys" > "$out/$name.log" 2>&1 &
  watch_memory $! "$out/$name.memory"
  wait $! || true
  if ! [ -s "$out/$name/summary.json" ]; then
    echo "| $name | failed or out of time: $(grep -m1 error "$out/$name.log") | | | | |"
    return
  fi
  unknowns=$(sed -n 's/.*"unknowns": *\([0-9]*\).*/\1/p' "$out/$name/summary.json" | head -1)
  bus=$(cat "$out/$name.info"* 2> /dev/null | sed -n 's/.*device: \([0-9]*\) bytes there, \([0-9]*\) back.*/\1 \2/p' | tail -1 | awk '{ print ($1 + $2) / 1e6 }')
  awk -F, -v name="$name" -v memory="$(cat "$out/$name.memory")" -v before="$before" -v unknowns="${unknowns:-1}" -v bus="$bus" '
    NR == 1 { for (i = 1; i <= NF; i++) at[$i] = i }
    NR > 1 { n++; energy = $at["kinetic_energy"]; if (n > 2) { s += $at["seconds_nse"]; all += $at["seconds"]; it += $at["outer_iterations"]; m++ } }
    END { printf "| %s | %.4f | %.4f | %.2f | %s | %s | %s |\n", name, s / m, all / m, it / m, energy,
          (memory + 0 > before + 0) ? sprintf("%.0f", (memory - before) / unknowns) : "", bus }' "$out/$name/series.csv"
}

if [ -n "$CHECK" ]; then
  TUMBLE_BUILD=$build TUMBLE_DEVICE=$device python3 -m pytest tests/runs/test_device.py -q -k "box or refined or crosses or goes" | tail -3
fi
echo "| run | s a step, flow | s a step | outer iterations | kinetic energy | bytes an unknown | MB over the bus a step |"
echo "| --- | --- | --- | --- | --- | --- | --- |"
for n in ${SIZES:-64 128}; do
  for preset in ${PRESETS:-balanced fast}; do
    scene="-mesh_cells $n,$n,$n -preset $preset -sim_dt 5e-3 -sim_steps ${STEPS:-5}"
    measure "$preset-$n-$device" 1 $scene -device "$device"
    if [ "$n" -le 64 ]; then measure "$preset-$n-$ranks-cores" "$ranks" $scene; fi
  done
done
# spheres of ten cells: some 5 MB each over the bus in a step, and one core that draws them (src/device/README.md)
for n in ${SPHERES:-64 128}; do
  edge=$((n * 10 / 128))
  if [ "$edge" -lt 1 ]; then edge=1; fi
  count=$((edge * edge * edge))
  radius=$(awk -v n="$n" 'BEGIN { print 5 / n }')
  scene="-mesh_cells $n,$n,$n -flow_solver balanced -sim_dt 2e-3 -sim_steps ${STEPS:-5} -flow_gravity 0,0,-1 -flow_velocity_operator matrix_free"
  measure "0-spheres-$n-$device" 1 $scene -device "$device"
  measure "$count-spheres-$n-$device" 1 $scene -couple_method penalty -particle_groups ball -particle_ball_shape circle \
    -particle_ball_radius "$radius" -particle_ball_count "$count" -particle_ball_place lattice -particle_ball_density 1.5 -device "$device"
done
# the whole step by kernels: calls, MB, seconds (each kernel is waited for), GB/s
if [ $((limit - SECONDS)) -gt 15 ]; then
  n=$(echo "${SIZES:-64}" | awk '{ print $1 }')
  timeout $((limit - SECONDS)) "$build/tumble" runs/bench/cavity-3d.yaml -mesh_cells "$n,$n,$n" -preset balanced -sim_dt 5e-3 -sim_steps 3 -output_dir "$out/table" \
    -output_every 0 -device "$device" -device_table | grep "^| " | sed "1s/^/\n/" || true
fi
if [ -x "$build/kernels/kernels" ] && [ $((limit - SECONDS)) -gt 10 ]; then
  SIZES=64 timeout $((limit - SECONDS)) runs/bench/kernels.sh "$build/kernels" || true
fi
echo "$SECONDS s"
