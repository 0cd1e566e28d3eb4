/* The flow on a device: with -device, vectors of solvers lie in its memory, and products are made there by the kernels
   of device/device.h. Where FlowStaysOnDevice, the fields of a step lie there too and go to the host only when somebody
   asks for them. Arrays below lie there, except where "host" is said. Products, of own nodes and cells, are collective:
   each rank has a device, and PetscSF brings values at ghosts. */
#pragma once
#include "device/device.h"
#include "flow/flow.h"

/* NULL: everything lies in the memory of the processor */
const DeviceQueue *FlowGetQueue(Flow);
/* y [nnode][dim] = S x, of own nodes. masked: components that boundary conditions fix count as zero in x, and are zero
   in y, but for terms of participants, which take x as it is. */
PetscErrorCode FlowMultiplyOnDevice(Flow, PetscBool masked, const PetscReal x[], PetscReal y[]);
/* inverse [nnode][dim] = 1 over the diagonal of S, which counts as `min` lumped masses at least; 0 where it is 0 */
PetscErrorCode FlowInvertDiagonalOnDevice(Flow, PetscReal min, PetscReal inverse[]);

/* y [ncell][4] = factor B u; y [nnode][dim] = factor B^T p, zero where boundary conditions fix components */
PetscErrorCode FlowDivergenceOnDevice(Flow, PetscReal factor, const PetscReal u[], PetscReal y[]);
PetscErrorCode FlowGradientOnDevice(Flow, PetscReal factor, const PetscReal p[], PetscReal y[]);
/* y += factor Mp^{-1} r */
PetscErrorCode FlowPressureMassOnDevice(Flow, PetscReal factor, const PetscReal r[], PetscReal y[]);
/* Terms of FlowAddCellTerms, after that: integrals over a part of each cell of products of two basis functions at
   lattice positions, as products of 6 pairs along the axes (00 01 02 11 12 22, the last axis slowest). without [n]:
   bits of slots whose rows and columns are left out; ball [n], where edge[0] > 0: what the moments are made from there,
   by nsample samples an axis (NULL: none is); moment [..][216]: of the others, in their order. Borrowed. Local. */
typedef struct {
  const PetscInt   *without;
  const DeviceBall *ball;
  PetscInt          nsample;
  const PetscReal  *moment;
} FlowMoments;
PetscErrorCode FlowDescribeCellTerms(Flow, const void *owner, const FlowMoments *);
/* Rows row [n] of B W B^T to places at [n], weight [nnode][dim]: see DeviceBodyKernels. Of all cells on one rank. */
PetscErrorCode FlowMakeRowsOnDevice(Flow, const PetscReal weight[], PetscInt n, const int row[], const int at[],
                                    const DeviceRows *);
/* Are all own cells boxes of the fluid, where nodes may hang? Then A between their vertices += what `add_boxes` of
   device.h makes of n cells. Of all cells on one rank. */
PetscBool      FlowHasBoxesAlone(Flow);
PetscErrorCode FlowAddBoxesOnDevice(Flow, const DeviceTransfer *, PetscInt n, const int cell[], const double k[],
                                    const DeviceSparse *A);
/* Parts of S of the step, on one rank: n of its cells, any of them several times, with nodes node [n][27] of their own
   among nnode, and the terms of participants in each. Memory grows; the caller destroys it. y [nnode][3] += that times
   x. */
typedef struct {
  int           n; /* nodes */
  DeviceCells   cells;
  DeviceMoments moments;
  size_t        capacity[7];
} FlowNear;
PetscErrorCode FlowNearRenew(Flow, PetscInt nnode, PetscInt n, const PetscInt cell[], const PetscInt node[],
                             FlowNear *);
PetscErrorCode FlowNearMultiply(Flow, const FlowNear *, const PetscReal x[], PetscReal y[]);
PetscErrorCode FlowNearDestroy(Flow, FlowNear *);
/* y [nnode][dim] = m x, or 1/m (inverse), by the lumped mass over the density */
PetscErrorCode FlowScaleByMassOnDevice(Flow, const PetscReal x[], PetscReal y[]);
PetscErrorCode FlowInvertMassOnDevice(Flow, PetscReal y[]);
/* q [ncell][dim + 1] += the pressure factor.(x - lower corner of the domain) */
PetscErrorCode FlowAddLinearOnDevice(Flow, const PetscReal factor[], PetscReal q[]);
/* Of a b by entries [nnode][dim] (a NULL: of b): sums over own nodes by components, then those of sizes. Local. */
PetscErrorCode FlowSumProductsOnDevice(Flow, const PetscReal a[], const PetscReal b[], PetscReal sum[6]);

/* ---- fields that stay there ---- */

/* Do fields stay there in this step? Then FlowExtrapolate, FlowRhs and FlowAcceptStep leave the arrays that they are
   given alone, and FlowSolverSolve, FlowDiagnose of no arrays work on the following ones. */
PetscBool FlowStaysOnDevice(Flow);
/* They never do from now on */
PetscErrorCode FlowLeaveDevice(Flow);
/* Right-hand side; velocity of the step before; start value, then solution of the step, borrowed until FlowAcceptStep;
   dp as for FlowExtrapolate */
typedef struct {
  const PetscReal *rhs, *before;
  PetscReal       *u, *p, *dp;
} FlowDeviceStep;
PetscErrorCode FlowGetStepOnDevice(Flow, FlowDeviceStep *);
/* The right-hand side += factor v [nnode][dim] */
PetscErrorCode FlowAddRhsOnDevice(Flow, PetscReal factor, const PetscReal v[]);
/* Rows row[k], each once, of nodal (size dim) or cell arrays (dim + 1) there and of the host: fetched, sent, added */
PetscErrorCode FlowFetchRows(Flow, PetscInt n, PetscInt size, const PetscInt row[], const PetscReal there[],
                             PetscReal here[]);
PetscErrorCode FlowSendRows(Flow, PetscInt n, PetscInt size, const PetscInt row[], const PetscReal here[],
                            PetscReal there[]);
PetscErrorCode FlowAddRows(Flow, PetscInt n, PetscInt size, const PetscInt row[], const PetscReal here[],
                           PetscReal there[]);
/* Largest component of u^n - frame, a number on the host */
PetscErrorCode FlowGetSpeedOnDevice(Flow, const PetscReal frame[3], PetscReal *speed);
/* The step's solution to arrays u [nnode_all][dim], p of the host, unless they have it, or always had */
PetscErrorCode FlowTakeSolution(Flow, PetscReal u[], PetscReal p[]);

/* Nodes, own cells and points whose part of a solution the host wants in every step; points are slots of listed cells,
   27 times the place of the cell in the list + slot, ascending. Borrowed. */
typedef struct _p_FlowDeviceList *FlowDeviceList;
PetscErrorCode FlowListCreate(Flow, PetscInt nnode, const PetscInt node[], PetscInt ncell, const PetscInt cell[],
                              PetscInt npoint, const PetscInt point[], FlowDeviceList *);
PetscErrorCode FlowListDestroy(Flow, FlowDeviceList *);
/* Of the step's solution to arrays of the host: u and p at listed nodes and cells alone, r [npoint][dim] as
   FlowCellResiduals */
PetscErrorCode FlowListTake(Flow, FlowDeviceList, PetscReal u[], PetscReal p[], PetscReal r[]);

/* PetscCall of a kernel of the queue */
#define PetscCallDevice(queue, ...) \
  do { \
    const int error_ = (__VA_ARGS__); \
\
    PetscCheck(!error_, PETSC_COMM_SELF, PETSC_ERR_GPU, "%s: %s", #__VA_ARGS__, (*(queue)->run->explain)(error_)); \
  } while (0)

/* *p = memory for n of the pointer's numbers, filled from host unless that is NULL; DeviceFree frees and forgets it */
#define DeviceTake(queue, n, host, p) DeviceTakeBytes(queue, (size_t)(n) * sizeof(**(p)), host, (void **)(p))
PetscErrorCode DeviceTakeBytes(const DeviceQueue *, size_t bytes, const void *host, void **p);
PetscErrorCode DeviceTakeInts(const DeviceQueue *, PetscInt n, const PetscInt host[], const int **p);
/* n numbers of the host (NULL: none) into *p, memory for *capacity of them, which grows */
#define DeviceRenew(queue, n, host, p, capacity) \
  DeviceRenewBytes(queue, (size_t)(n), sizeof(**(p)), host, (void **)(p), capacity)
PetscErrorCode DeviceRenewBytes(const DeviceQueue *, size_t n, size_t size, const void *host, void **p,
                                size_t *capacity);
PetscErrorCode DeviceRenewInts(const DeviceQueue *, PetscInt n, const PetscInt host[], const int **p, size_t *capacity);
/* Pairs in any order, width numbers of each value [n][width], of the host: sorted by bodies, else in their order, into
   *p, whose memory grows likewise; value NULL: there is room for them; and its memory */
PetscErrorCode DevicePairsRenew(const DeviceQueue *, PetscInt n, PetscInt nbody, PetscInt width, const PetscInt body[],
                                const PetscInt at[], const PetscReal value[], DevicePairs *p, size_t capacity[4]);
PetscErrorCode DevicePairsDestroy(const DeviceQueue *, DevicePairs *);
#define DeviceFree(queue, p) DeviceFreeBytes(queue, (void **)(p))
PetscErrorCode DeviceFreeBytes(const DeviceQueue *, void **p);
