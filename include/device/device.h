/* Device: kernels of the step in space for arrays in the memory of the processor or of a GPU, from one source
   (src/device/kernel.h). They take plain arrays and know neither a mesh nor an equation.

   A DeviceQueue says where arrays lie and in which order work is done there. `run` is the table of the kernels of that
   memory: of the processor (always there; blocks and threads of the GPU are loops, which is how kernels are tested), or
   of a GPU where the program was built with it. All arrays of a call, and those of structs, lie in the queue's memory,
   except where "host" is said. Work on a GPU may go on when a function returns; `wait` waits for it.

   Functions return 0, or a number that `explain` says in words. Nothing here is collective or calls PETSc. */
#pragma once
#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct _n_DeviceKernels DeviceKernels;

typedef struct {
  const DeviceKernels *run;
  void                *stream; /* cudaStream_t; the processor has none */
} DeviceQueue;

/* ---- cells ---- */

#define DEVICE_GROUP       32 /* cells side by side: the lanes of a warp */
#define DEVICE_NODE_BITS   28
#define DEVICE_MAX_NODES   (1 << DEVICE_NODE_BITS)
#define DEVICE_HANG_SLOTS  27
#define DEVICE_HANG_WEIGHT 243

/* A way in which nodes hang in a cell (mesh/hang.h): values at positions slot[r] are sums of weight times those in the
   slots from, entries start[r] to start[r + 1] */
typedef struct {
  int    n, slot[DEVICE_HANG_SLOTS], start[DEVICE_HANG_SLOTS + 1], from[DEVICE_HANG_WEIGHT];
  double weight[DEVICE_HANG_WEIGHT];
} DeviceHang;

/* Hexahedra of 27 nodes, node j at lattice position (j % 3, (j/3) % 3, j/9), in groups of 32 places: first nbox groups
   of boxes along the axes, then the others; of both first those in which nothing hangs. */
typedef struct {
  int nnode, ncell; /* of nodal and cell arrays */
  int ngroup, nbox; /* groups */
  /* [place][27] node, with bit DEVICE_NODE_BITS + a where its component a is fixed; -1: the place is empty */
  const int        *node;
  const int        *cell; /* [place] or -1 */
  const int        *hang; /* [place] in hangs, -1: nothing hangs; NULL: nowhere */
  const DeviceHang *hangs;
  const double     *box;      /* [group < nbox][4][32] det J, the diagonal of J^-1 */
  const double     *position; /* [group - nbox][81][32] coordinates of lattice positions, [27][3] */
} DeviceCells;

/* What DeviceCellsCreate takes: host arrays */
enum {
  DEVICE_NONE, /* no part of the fluid: left out */
  DEVICE_BOX,
  DEVICE_OTHER
};

typedef struct {
  int                  nnode, ncell, nhang;
  const int           *node; /* [ncell][27] */
  const unsigned char *kind; /* [ncell] */
  const int           *hang; /* [ncell] in hangs [nhang], -1: nothing hangs; NULL: nowhere */
  const DeviceHang    *hangs;
  const double        *box;      /* [ncell][4] det J, the diagonal of J^-1; of boxes */
  const double        *position; /* [others][27][3], in their order */
} DeviceMesh;

/* In the queue's memory, to be destroyed by the caller. Cells keep their order but for their kinds and ways to hang. */
int DeviceCellsCreate(const DeviceQueue *, const DeviceMesh *, DeviceCells *);
int DeviceCellsDestroy(const DeviceQueue *, DeviceCells *);

/* ---- velocity operator ---- */

/* a (u, v) + ((b + nu) grad u, grad v) + scale (w . grad u + skew div w u, v), as BatchForm (fem/batch.h) */
typedef struct {
  int    convection, vary; /* are w and nu there? */
  double a, b, skew, scale, nu_factor;
} DeviceForm;

/* Coefficients of all cells at their points: numbers that they take */
size_t DeviceCoefficients(const DeviceCells *, const DeviceForm *);

struct _n_DeviceKernels {
  const char *name; /* cpu, cuda */

  /* ---- memory ---- */
  int (*allocate)(const DeviceQueue *, size_t bytes, void **);
  int (*release)(const DeviceQueue *, void *);
  int (*upload)(const DeviceQueue *, size_t bytes, const void *host, void *);
  int (*download)(const DeviceQueue *, size_t bytes, const void *, void *host);
  int (*zero)(const DeviceQueue *, size_t bytes, void *);
  int (*wait)(const DeviceQueue *);
  const char *(*explain)(int error);

  /* ---- cells ---- */
  /* Which components of nodes are fixed: bits 0 to 2 of fixed [nnode] go into `node` of the cells (NULL: none are) */
  int (*set_fixed)(const DeviceQueue *, const DeviceCells *, const unsigned char fixed[], int node[]);
  /* to[slot[k]] = from[slot[k]], k < n */
  int (*copy_slots)(const DeviceQueue *, int n, const int slot[], const double from[], double to[]);

  /* ---- velocity operator ---- */
  /* Coefficients for w [nnode][3], nu [ncell][27] at the points, the first axis slowest; NULL where the form says so */
  int (*set_coefficients)(const DeviceQueue *, const DeviceCells *, const DeviceForm *, const double w[],
                          const double nu[], double coefficient[]);
  /* y [nnode][3] += the operator times x [nnode][3]. masked: fixed components of x count as zero, and nothing is added
     to those of y. */
  int (*multiply)(const DeviceQueue *, const DeviceCells *, const DeviceForm *, const double coefficient[], int masked,
                  const double x[], double y[]);
};

/* Tables of kernels. DeviceGetKernels: "cpu" or "cuda", NULL where the program was built without it. */
const DeviceKernels *DeviceGetKernels(const char name[]);

#ifdef __cplusplus
}
#endif
