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

/* Of a function of the table below: calls, bytes that it reads and writes at least, seconds */
typedef struct {
  const char *name; /* with the memory's behind it, such as multiply_cuda */
  double      calls, bytes, seconds;
} DeviceCount;

#define DEVICE_COUNTS 64

typedef struct {
  int         n;
  double      begun; /* since then a kernel runs; 0: none */
  DeviceCount count[DEVICE_COUNTS];
} DeviceCounts;

/* Bytes that have gone there and back; that are taken now (of the processor's memory alone), and at
   most so far: there without PETSc's vectors, on a GPU all that is in use, where kernels are counted */
typedef struct {
  double        up, down, taken, most;
  DeviceCounts *counts; /* NULL: nobody asks; else each kernel is waited for */
} DeviceTraffic;

typedef struct {
  const DeviceKernels *run;
  void                *stream;  /* cudaStream_t; the processor has none */
  DeviceTraffic       *traffic; /* of upload and download; NULL: nobody counts */
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
  double corner[64]; /* [corner][vertex] what multilinear functions of the cell's vertices are at its corners */
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
  /* [place] the place in other cells, which have `of_boxes` groups of boxes, whose coefficients products take; NULL:
     cells have their own. Places are of the same kind. */
  const int *from;
  int        of_boxes;
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
  const double        *position; /* [others][27][3], in their order; NULL: not needed */
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

/* ---- products with B ---- */

/* Matrices b [81][4] of cells, row 3 j + a for component a in slot j, a column for each pressure, and the inverse
   masses of their pressures: of boxes those of kinds, of others their own */
typedef struct {
  const int    *kind;                   /* [group < nbox][32] */
  const double *shared;                 /* [kinds][81][4] */
  const double *own;                    /* [group - nbox][81][4][32] */
  const double *shared_mass, *own_mass; /* [kinds][4][4], [group - nbox][32][4][4] */
} DeviceDivergence;

/* ---- rows of the pressure operator ---- */

/* Rows of blocks 4 x 4, each column by column (entry (k, m) at 4 m + k); rows that are equal stand once. Four numbers a
   row in vectors. */
typedef struct {
  int        n, nentry, nblock; /* rows, blocks in them, blocks that are kept */
  const int *start;             /* [n + 1] in column */
  const int *column;            /* block columns */
  int       *at;                /* [n] in value and single, in blocks */
  int       *kind;              /* [n] in inverse */
  double    *value;             /* [blocks][16] */
  float     *single;            /* the same */
  float     *inverse;           /* [kinds][16] of the blocks on the diagonal, or what stands for them in smoothers */
} DeviceRows;

/* x and d of a Chebyshev iteration about the diagonal: d = c1 d + c2 D^-1 (b - A x), x_new = x + d. x NULL: from zero,
   where c1 is not read. x_new is not x. */
typedef struct {
  double        c1, c2;
  const double *b, *x;
  double       *d, *x_new;
} DeviceChebyshev;

/* ---- transfer between pressures of cells and vertices ---- */

typedef struct {
  int           ncell, nvertex;
  const int    *vertex; /* [8][ncell] */
  const int    *form;   /* [ncell] */
  const double *fit;    /* [forms][4][8] pressures of a cell from the values at its vertices */
} DeviceTransfer;

/* Sparse matrices with at most `width` entries a row; those that are not there are 0 times column 0 */
typedef struct {
  int           n, width;
  const int    *column; /* [width][n] */
  const double *value;  /* [width][n] */
} DeviceSparse;

/* ---- bodies ---- */

/* Pairs of a body and a node or a cell, by bodies, and numbers of theirs. Of a node, 4: there the rigid velocity (V, W)
   is weight V + W x arm; with bit DEVICE_NODE_BITS + a where component a has no part. Of a cell, 24: a block w [4][6],
   what a pressure is to a body. */
typedef struct {
  int           n, nbody;
  const int    *start; /* [nbody + 1] */
  const int    *at;    /* [n] node or cell */
  const int    *body;  /* [n] */
  const double *value; /* [4 or 24][n] */
} DevicePairs;

/* Parts of cells with a mass of their own, such as a penalty: strength times integrals of products of two basis
   functions over the part, which are products of 6 pairs of functions along the axes, 00 01 02 11 12 22. Rows and
   columns of nodes in `without` are left out. In groups of 32 places. */
typedef struct {
  int               ngroup;
  const int        *node;    /* [place][27], -1: the place is empty */
  const int        *without; /* [place] bits of slots */
  const int        *hang;    /* [place] in hangs, -1: nothing hangs; NULL: nowhere */
  const DeviceHang *hangs;   /* borrowed */
  const double     *moment;  /* [group][216][32] */
  const int        *from;    /* [place] whose moments a part has, or NULL: its own */
} DeviceMoments;

/* What the velocity operator has between nodes and bodies: entries are pairs of a node and a body that cells have as
   their nodes (DeviceCells.from). A rigid velocity is linear in the place, so four numbers an entry do: the operator
   times 1 and times the way from the body's centre, at the nodes that the body moves. */
typedef struct {
  int           n, narm; /* entries; nodes that bodies move */
  const int    *entry;   /* [narm] that of a node and the body that moves it */
  const double *arm;     /* [narm][4] 1, way from the centre */
  double       *x, *y;   /* [2][n][3] numbers 0 to 2, then the last, 0, 0: as they are, times the operator */
} DeviceEntries;

/* The part of a cell, a box along the axes, that lies in a ball: its lowest corner as seen from the centre, its edges,
   the radius (of a whole cell larger than all), the way in which the share at a sample falls from 1 to 0; moments are
   multiplied by factor */
typedef struct {
  double lower[3], edge[3], radius, width, factor;
} DeviceBall;

#define DEVICE_MAX_SAMPLES 20

typedef struct {
  /* y [nnode][3] += factor times the rigid velocities U [nbody][6]; out [nbody][6] = factor times the forces and
     torques of x [nnode][3] */
  int (*add_rigid)(const DeviceQueue *, const DevicePairs *, double factor, const double U[], double y[]);
  int (*sum_rigid)(const DeviceQueue *, const DevicePairs *, double factor, const double x[], double out[]);
  /* y [cells][4] += factor w U; out [nbody][6] = sums of w^T x */
  int (*add_blocks)(const DeviceQueue *, const DevicePairs *, double factor, const double U[], double y[]);
  int (*sum_blocks)(const DeviceQueue *, const DevicePairs *, const double x[], double out[]);
  /* y [nnode][3] += the parts times x; d [nnode] += their diagonal */
  int (*multiply_moments)(const DeviceQueue *, const DeviceMoments *, const double x[], double y[]);
  int (*add_moments_diagonal)(const DeviceQueue *, const DeviceMoments *, double d[]);
  /* Moments of parts in balls: ball [n], by nsample^3 samples each, go to places place [n] of moment */
  int (*make_moments)(const DeviceQueue *, int n, int nsample, const int place[], const DeviceBall ball[],
                      double moment[]);
  /* Rows of the pressure near bodies, made there: rows row [n], each once, of B W B^T with weights [nnode][3], at
     places at [n] of their own; place [ncell]: of cells in groups */
  int (*make_rows)(const DeviceQueue *, const DeviceCells *, const DeviceDivergence *, const int place[],
                   const double weight[], int n, const int row[], const int at[], const DeviceRows *);
  /* Their blocks on the diagonal += block [n][16] */
  int (*add_to_diagonal)(const DeviceQueue *, int n, const int row[], const double block[], const DeviceRows *);
  /* to [n] = from */
  int (*narrow)(const DeviceQueue *, size_t n, const double from[], float to[]);
  /* Inverses of their blocks on the diagonal with the w w^T of pairs, whose cells are all among these rows; where
     [rows.n] and block [n][16] are lost. Each row has a kind of its own. */
  int (*invert_rows)(const DeviceQueue *, int n, const int row[], const DevicePairs *, int where[], double block[],
                     const DeviceRows *);
  /* x = the arms at their entries, else 0; y = 0 */
  int (*place_arms)(const DeviceQueue *, const DeviceEntries *);
  /* y -= the four numbers of pairs, at entry [pairs], each once; -1: nowhere */
  int (*subtract_pairs)(const DeviceQueue *, const DevicePairs *, const int entry[], const DeviceEntries *);
  /* value [4][n] = y at entry [n] */
  int (*take_pairs)(const DeviceQueue *, const DeviceEntries *, int n, const int entry[], double value[]);
  /* out [n][4][4] = sums over start[k] <= i < start[k + 1] of the products of the numbers of arm[i] and of y at
     entry[i]; nterm of them in all */
  int (*sum_entries)(const DeviceQueue *, const DeviceEntries *, int n, int nterm, const int start[], const int arm[],
                     const int entry[], double out[]);
} DeviceBodyKernels;

typedef struct {
  /* v [nvertex] += the transposed fit of r [ncell][4]; x [ncell][4] += the fit of v */
  int (*add_restricted)(const DeviceQueue *, const DeviceTransfer *, const double r[], double v[]);
  int (*add_interpolated)(const DeviceQueue *, const DeviceTransfer *, const double v[], double x[]);
  /* Entries that are there, of matrices between vertices: A += the integrals of sum over axes a of k[a] times products
     of slopes along a, over n cells that are boxes, k [n][3]; += value [n] in rows row and columns column; C = P^T A P;
     inverse [n] of the diagonal */
  int (*add_boxes)(const DeviceQueue *, const DeviceCells *, const int place[], const DeviceTransfer *, int n,
                   const int cell[], const double k[], const DeviceSparse *A);
  int (*add_entries)(const DeviceQueue *, int n, const int row[], const int column[], const double value[],
                     const DeviceSparse *A);
  int (*coarsen)(const DeviceQueue *, const DeviceSparse *A, const DeviceSparse *P, const DeviceSparse *C);
  int (*invert_sparse)(const DeviceQueue *, const DeviceSparse *A, double inverse[]);
} DeviceVertexKernels;

typedef struct {
  /* y [nnode][3] = weight [nnode] x; y = |x| by entries */
  int (*scale_nodes)(const DeviceQueue *, int nnode, const double weight[], const double x[], double y[]);
  int (*take_sizes)(const DeviceQueue *, size_t n, const double x[], double y[]);
  /* y [ncell][4] += the linear pressure with gradient factor, on the host; centre [ncell][4]: middle and size of cells
   */
  int (*add_linear)(const DeviceQueue *, int ncell, const double centre[], const double factor[3], double y[]);
  /* out [3] = sums over nodes of weight [nnode] (NULL: 1) times such a combination of arrays [nnode][3]; the same bits
     in every run */
  int (*sum_components)(const DeviceQueue *, int nnode, const double weight[], int nv, const double *const v[],
                        const double factor[], double partial[], double out[]);
} DeviceBalanceKernels;

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
  /* to[slot[k]] = value[k]; the same number in all; out [n][size] = rows row[k] of from [..][size] */
  int (*set_slots)(const DeviceQueue *, int n, const int slot[], const double value[], double to[]);
  int (*fill_slots)(const DeviceQueue *, int n, const int slot[], double value, double to[]);
  int (*pick)(const DeviceQueue *, int n, int size, const int row[], const double from[], double out[]);
  /* rows row[k], each once, of to [..][size] = value [n][size], or += */
  int (*put)(const DeviceQueue *, int n, int size, const int row[], const double value[], double to[]);
  int (*add)(const DeviceQueue *, int n, int size, const int row[], const double value[], double to[]);

  /* ---- velocity operator ---- */
  /* Coefficients for w [nnode][3], nu [ncell][27] at the points, the first axis slowest; NULL where the form says so */
  int (*set_coefficients)(const DeviceQueue *, const DeviceCells *, const DeviceForm *, const double w[],
                          const double nu[], double coefficient[]);
  /* y [nnode][3] += the operator times x [nnode][3]. masked: fixed components of x count as zero, and nothing is added
     to those of y. */
  int (*multiply)(const DeviceQueue *, const DeviceCells *, const DeviceForm *, const double coefficient[], int masked,
                  const double x[], double y[]);
  /* d [nnode] += its diagonal, the same for all components; of cells where something hangs that of H^T K H */
  int (*add_diagonal)(const DeviceQueue *, const DeviceCells *, const DeviceForm *, const double coefficient[],
                      double d[]);
  /* out [nnode][3] = 1 over the larger of d and min times mass [nnode]; 0 where d is 0 */
  int (*invert_diagonal)(const DeviceQueue *, int nnode, double min, const double mass[], const double d[],
                         double out[]);
  /* y [nnode][3] += scale a M (sum over k < n <= 4 of factor[k] v[k] + constant), a of the form; v [n] on the host:
     arrays [nnode][3] */
  int (*add_mass)(const DeviceQueue *, const DeviceCells *, const DeviceForm *, const double coefficient[],
                  double scale, int n, const double *const v[], const double factor[], const double constant[3],
                  double y[]);

  /* ---- products with B ---- */
  /* out [ncell][4] = alpha B u + beta in, of cells that have a place; in NULL: without */
  int (*divergence)(const DeviceQueue *, const DeviceCells *, const DeviceDivergence *, double alpha, const double u[],
                    double beta, const double in[], double out[]);
  /* y [nnode][3] += alpha weight B^T p; weight [nnode][3] or NULL; masked: nothing to fixed components */
  int (*add_gradient)(const DeviceQueue *, const DeviceCells *, const DeviceDivergence *, int masked, double alpha,
                      const double weight[], const double p[], double y[]);

  /* out [ncell][4], first of the four = sum of squares of the integrals of du_i/dx_a, of cells with a place */
  int (*gradients)(const DeviceQueue *, const DeviceCells *, const DeviceDivergence *, const double u[], double out[]);
  /* y [ncell][4] += factor times the inverse masses times r [ncell][4] */
  int (*add_pressure_mass)(const DeviceQueue *, const DeviceCells *, const DeviceDivergence *, double factor,
                           const double r[], double y[]);

  /* ---- pressure ---- */
  /* y = A x, r = b - A x by the rows as they are or in single precision, a Chebyshev step in single precision */
  int (*multiply_rows)(const DeviceQueue *, const DeviceRows *, const double x[], double y[]);
  int (*residual_rows)(const DeviceQueue *, const DeviceRows *, const double b[], const double x[], double r[]);
  int (*smooth_rows)(const DeviceQueue *, const DeviceRows *, const DeviceChebyshev *);
  /* y = A x (add: +=), y += A^T x, r = b - A x, a Chebyshev step about the diagonal with inverse [n] */
  int (*multiply_sparse)(const DeviceQueue *, const DeviceSparse *, int add, const double x[], double y[]);
  int (*add_transposed)(const DeviceQueue *, const DeviceSparse *, const double x[], double y[]);
  int (*residual_sparse)(const DeviceQueue *, const DeviceSparse *, const double b[], const double x[], double r[]);
  int (*smooth_sparse)(const DeviceQueue *, const DeviceSparse *, const double inverse[], const DeviceChebyshev *);

  /* ---- sums ---- */
  /* out [2] = sums of a b and of c d over n numbers; c NULL: out [1] only. partial [DEVICE_PARTIAL] is lost. The same
     bits in every run. */
  int (*dot)(const DeviceQueue *, size_t n, const double a[], const double b[], const double c[], const double d[],
             double partial[], double out[]);

  /* ---- nodal fields ---- */
  /* out [n] = sum over k < nv <= 4 of factor[k] v[k] + constant[i % 3] (NULL: 0), which may be one of v; v, factor and
     constant on the host */
  int (*combine)(const DeviceQueue *, size_t n, int nv, const double *const v[], const double factor[],
                 const double constant[3], double out[]);
  /* y = weight x by entries */
  int (*scale)(const DeviceQueue *, size_t n, const double weight[], const double x[], double y[]);
  /* out [1] = largest of weight (NULL: 1) |v - shift[i % 3]|, shift NULL: 0, on the host; no numbers do not count */
  int (*largest)(const DeviceQueue *, size_t n, const double v[], const double weight[], const double shift[3],
                 double partial[], double out[]);
  /* out [2][ncell] = squares of the largest speeds at the positions of cells that have a place: of u, and of u - frame
     (on the host) */
  int (*speeds)(const DeviceQueue *, const DeviceCells *, const double frame[3], const double u[], double out[]);

  DeviceBalanceKernels balance; /* of momentum */
  DeviceBodyKernels    body;
  DeviceVertexKernels  vertices;
};

#define DEVICE_PARTIAL 2048

/* ---- cycles, on the host over the kernels ---- */

/* A level of a multigrid hierarchy; work vectors [A.n] of its own */
typedef struct {
  DeviceSparse  A, P;    /* P: from the next level to this one; the lowest level has none, and in A its inverse */
  const double *inverse; /* of the diagonal */
  double        largest; /* eigenvalue of D^-1 A, or a bound */
  double       *x, *y, *b, *d;
} DeviceLevel;

/* x of the first of n levels from its b: Chebyshev of a degree for the upper 7/10 of the spectrum, there and back.
   x and y may have changed places. */
int DeviceCycle(const DeviceQueue *, int n, int degree, DeviceLevel level[]);

/* What other ranks have to do with a cycle, by who knows them; each returns an error or 0. Vectors x have room for
   blocks of other ranks behind their own. */
typedef struct {
  void *ctx;
  int (*fetch)(void *ctx, double x[]);                     /* those blocks of x */
  int (*sum)(void *ctx, double U[]);                       /* [body.nbody][6] over ranks */
  int (*correct)(void *ctx, const double r[], double x[]); /* x += what the vertices make of r */
} DeviceRanks;

/* Two levels for the pressure: Chebyshev over cells for [largest / 8, largest], the cycle over the vertices, back */
typedef struct {
  DeviceRows     rows;
  DeviceTransfer transfer;
  int            degree, nlevel;
  double         largest;   /* eigenvalue of D^-1 S_p, or a bound */
  double        *x, *r, *d; /* work [rows.n][4], on several ranks with room for those of others */
  double        *y;         /* likewise, on several ranks */
  DeviceLevel   *level;
  DevicePairs    body;        /* the operator has w w^T beside the rows; n = 0: no bodies, the rest is not read */
  double        *U, *shifted; /* work [body.nbody][6], [rows.n][4] */
  DeviceRanks    ranks;       /* ctx NULL: one rank, no level is somebody else's */
} DevicePressure;

/* *out = b - w w^T x, in p->shifted, or b itself where there are no bodies */
int DevicePressureShift(const DeviceQueue *, const DevicePressure *, const double b[], const double x[],
                        const double **out);

/* z = the preconditioner times b, [rows.n][4] */
int DevicePressureApply(const DeviceQueue *, const DevicePressure *, const double b[], double z[]);

/* Tables of kernels. DeviceGetKernels: "cpu" or "cuda", NULL where the program was built without it. */
const DeviceKernels *DeviceGetKernels(const char name[]);

#ifdef __cplusplus
}
#endif
