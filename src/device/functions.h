/* The functions of one memory, as table.c lists them; what they do is in device.h */
#pragma once
#include "kernel.h"

/* Blocks of a sum over n numbers, at most `most`: others would have none */
HOST int BlocksOfSum(Big n, int threads, int most)
{
  return (n + threads - 1) / threads < most ? (int)((n + threads - 1) / threads) : most;
}

#ifdef __cplusplus
extern "C" {
#endif

/* memory.c */
int         NAME(allocate)(const DeviceQueue *, size_t, void **);
int         NAME(release)(const DeviceQueue *, void *);
int         NAME(upload)(const DeviceQueue *, size_t, const void *, void *);
int         NAME(download)(const DeviceQueue *, size_t, const void *, void *);
int         NAME(zero)(const DeviceQueue *, size_t, void *);
int         NAME(wait)(const DeviceQueue *);
const char *NAME(explain)(int);
/* slots.c */
int NAME(set_fixed)(const DeviceQueue *, const DeviceCells *, const unsigned char[], int[]);
int NAME(copy_slots)(const DeviceQueue *, int, const int[], const double[], double[]);
int NAME(set_slots)(const DeviceQueue *, int, const int[], const double[], double[]);
int NAME(fill_slots)(const DeviceQueue *, int, const int[], double, double[]);
int NAME(pick)(const DeviceQueue *, int, int, const int[], const double[], double[]);
int NAME(put)(const DeviceQueue *, int, int, const int[], const double[], double[]);
int NAME(add)(const DeviceQueue *, int, int, const int[], const double[], double[]);
/* coefficients.c */
int NAME(set_coefficients)(const DeviceQueue *, const DeviceCells *, const DeviceForm *, const double[], const double[],
                           double[]);
/* product.c */
int NAME(multiply)(const DeviceQueue *, const DeviceCells *, const DeviceForm *, const double[], int, const double[],
                   double[]);
/* diagonal.c, mass.c */
int NAME(add_diagonal)(const DeviceQueue *, const DeviceCells *, const DeviceForm *, const double[], double[]);
int NAME(invert_diagonal)(const DeviceQueue *, int, double, const double[], const double[], double[]);
int NAME(add_mass)(const DeviceQueue *, const DeviceCells *, const DeviceForm *, const double[], double, int,
                   const double *const[], const double[], const double[3], double[]);
/* divergence.c */
int NAME(divergence)(const DeviceQueue *, const DeviceCells *, const DeviceDivergence *, double, const double[], double,
                     const double[], double[]);
int NAME(add_gradient)(const DeviceQueue *, const DeviceCells *, const DeviceDivergence *, int, double, const double[],
                       const double[], double[]);
/* measure.c */
int NAME(gradients)(const DeviceQueue *, const DeviceCells *, const DeviceDivergence *, const double[], double[]);
int NAME(add_pressure_mass)(const DeviceQueue *, const DeviceCells *, const DeviceDivergence *, double, const double[],
                            double[]);
int NAME(speeds)(const DeviceQueue *, const DeviceCells *, const double[3], const double[], double[]);
/* fields.c */
int NAME(combine)(const DeviceQueue *, size_t, int, const double *const[], const double[], const double[3], double[]);
int NAME(scale)(const DeviceQueue *, size_t, const double[], const double[], double[]);
int NAME(scale_nodes)(const DeviceQueue *, int, const double[], const double[], double[]);
int NAME(take_sizes)(const DeviceQueue *, size_t, const double[], double[]);
int NAME(add_linear)(const DeviceQueue *, int, const double[], const double[3], double[]);
int NAME(sum_components)(const DeviceQueue *, int, const double[], int, const double *const[], const double[], double[],
                         double[]);
int NAME(largest)(const DeviceQueue *, size_t, const double[], const double[], const double[3], double[], double[]);
/* rigid.c */
int NAME(add_rigid)(const DeviceQueue *, const DevicePairs *, double, const double[], double[]);
int NAME(sum_rigid)(const DeviceQueue *, const DevicePairs *, double, const double[], double[]);
int NAME(add_blocks)(const DeviceQueue *, const DevicePairs *, double, const double[], double[]);
int NAME(sum_blocks)(const DeviceQueue *, const DevicePairs *, const double[], double[]);
/* moments.c */
int NAME(multiply_moments)(const DeviceQueue *, const DeviceMoments *, const double[], double[]);
int NAME(add_moments_diagonal)(const DeviceQueue *, const DeviceMoments *, double[]);
/* makemoments.c */
int NAME(make_moments)(const DeviceQueue *, int, int, const int[], const DeviceBall[], double[]);
/* coupling.c */
int NAME(place_arms)(const DeviceQueue *, const DeviceEntries *);
int NAME(subtract_pairs)(const DeviceQueue *, const DevicePairs *, const int[], const DeviceEntries *);
int NAME(take_pairs)(const DeviceQueue *, const DeviceEntries *, int, const int[], double[]);
int NAME(sum_entries)(const DeviceQueue *, const DeviceEntries *, int, int, const int[], const int[], const int[],
                      double[]);
/* rows.c */
int NAME(multiply_rows)(const DeviceQueue *, const DeviceRows *, const double[], double[]);
int NAME(residual_rows)(const DeviceQueue *, const DeviceRows *, const double[], const double[], double[]);
int NAME(smooth_rows)(const DeviceQueue *, const DeviceRows *, const DeviceChebyshev *);
/* makerows.c */
int NAME(make_rows)(const DeviceQueue *, const DeviceCells *, const DeviceDivergence *, const int[], const double[],
                    int, const int[], const int[], const DeviceRows *);
int NAME(add_to_diagonal)(const DeviceQueue *, int, const int[], const double[], const DeviceRows *);
int NAME(narrow)(const DeviceQueue *, size_t, const double[], float[]);
int NAME(invert_rows)(const DeviceQueue *, int, const int[], const DevicePairs *, int[], double[], const DeviceRows *);
/* vertices.c */
int NAME(add_restricted)(const DeviceQueue *, const DeviceTransfer *, const double[], double[]);
int NAME(add_interpolated)(const DeviceQueue *, const DeviceTransfer *, const double[], double[]);
int NAME(multiply_sparse)(const DeviceQueue *, const DeviceSparse *, int, const double[], double[]);
int NAME(add_transposed)(const DeviceQueue *, const DeviceSparse *, const double[], double[]);
int NAME(residual_sparse)(const DeviceQueue *, const DeviceSparse *, const double[], const double[], double[]);
int NAME(smooth_sparse)(const DeviceQueue *, const DeviceSparse *, const double[], const DeviceChebyshev *);
/* galerkin.c */
int NAME(add_boxes)(const DeviceQueue *, const DeviceCells *, const int[], const DeviceTransfer *, int, const int[],
                    const double[], const DeviceSparse *);
int NAME(add_entries)(const DeviceQueue *, int, const int[], const int[], const double[], const DeviceSparse *);
int NAME(coarsen)(const DeviceQueue *, const DeviceSparse *, const DeviceSparse *, const DeviceSparse *);
int NAME(invert_sparse)(const DeviceQueue *, const DeviceSparse *, double[]);
/* sums.c */
int NAME(dot)(const DeviceQueue *, size_t, const double[], const double[], const double[], const double[], double[],
              double[]);

#ifdef __cplusplus
}
#endif
