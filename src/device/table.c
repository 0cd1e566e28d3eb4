/* Device: the table of the kernels of one memory. */
#include "functions.h"

#ifdef __cplusplus
extern "C" {
#endif
extern const DeviceKernels NAME(DeviceKernels);
#ifdef __cplusplus
}
#endif

/* In the order of device.h, which a C++ compiler wants */
const DeviceKernels NAME(DeviceKernels) = {
#ifdef __CUDACC__
  "cuda",
#else
  "cpu",
#endif
  NAME(allocate),
  NAME(release),
  NAME(upload),
  NAME(download),
  NAME(zero),
  NAME(wait),
  NAME(explain),
  NAME(set_fixed),
  NAME(copy_slots),
  NAME(set_slots),
  NAME(fill_slots),
  NAME(pick),
  NAME(put),
  NAME(add),
  NAME(set_coefficients),
  NAME(multiply),
  NAME(add_diagonal),
  NAME(invert_diagonal),
  NAME(add_mass),
  NAME(divergence),
  NAME(add_gradient),
  NAME(gradients),
  NAME(add_pressure_mass),
  NAME(multiply_rows),
  NAME(residual_rows),
  NAME(smooth_rows),
  NAME(multiply_sparse),
  NAME(add_transposed),
  NAME(residual_sparse),
  NAME(smooth_sparse),
  NAME(dot),
  NAME(combine),
  NAME(scale),
  NAME(largest),
  NAME(speeds),
  {NAME(scale_nodes), NAME(take_sizes), NAME(add_linear), NAME(sum_components)},
  {NAME(add_rigid), NAME(sum_rigid), NAME(add_blocks), NAME(sum_blocks), NAME(multiply_moments),
   NAME(add_moments_diagonal), NAME(make_moments), NAME(make_rows), NAME(add_to_diagonal), NAME(narrow),
   NAME(invert_rows), NAME(place_arms), NAME(subtract_pairs), NAME(take_pairs), NAME(sum_entries)},
  {NAME(add_restricted), NAME(add_interpolated), NAME(add_boxes), NAME(add_entries), NAME(coarsen),
   NAME(invert_sparse)},
};

#ifndef __CUDACC__
  #include <string.h>
  #ifdef TUMBLE_CUDA /* the same files are there as nvcc compiles them */
extern const DeviceKernels DeviceKernels_cuda;
  #endif

const DeviceKernels *DeviceGetKernels(const char name[])
{
  if (!strcmp(name, "cpu")) return &DeviceKernels_cpu;
  #ifdef TUMBLE_CUDA
  if (!strcmp(name, "cuda")) return &DeviceKernels_cuda;
  #endif
  return NULL;
}

#endif
