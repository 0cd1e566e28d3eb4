/* Inside of Pressure; for its files only. pressure.c: life cycle, update, two levels. pressurematrix.c: the nodes' part
   as a matrix. pressurecut.c: cells that bodies cut. pressurecycle.c: the two levels as one preconditioner. */
#pragma once
#include "pressure.h"
#include "coarse.h"
#include "../devicevec.h"

/* The nodes' part: pressurematrix.c */
typedef struct {
  Mat            matrix, shell;
  PetscBool      block_gs;                  /* matrix is BlockGS, its own smoother; or AIJ: another one was asked for */
  PetscInt      *where;                     /* [ncell_all] scratch: where a neighbour stands in the row at hand */
  unsigned char *slot;                      /* [entries of node_cell] which slot of the cell the node has */
  PetscInt      *neighbour_ptr, *neighbour; /* [ncell + 1]; local cells that share a node with a cell */
  PetscReal     *row;                       /* scratch, the longest row */
  PetscReal     *overlap;                   /* [ncell][nk][nk] or NULL on one rank, see set_overlap() */
} NodesLevel;

/* pressurecycle.c */
typedef struct {
  PetscBool  smoothers_set, own; /* of PCMG; the cycle is our own */
  PetscReal *residual;           /* [ncell][nk] of that cycle */
} TwoLevelCycle;

/* Bodies: pairs of a body and a cell where B R_k is not zero */
typedef struct {
  PetscInt   n, capacity, *cell, *body, *local; /* cell; body, and its index among the local ones */
  PetscReal *w;                                 /* [n][nk][nr] B R_k L_k with L_k L_k^T = M_k^{-1} */
  PetscReal *work;                              /* [local bodies][nr] */
} CutLevel;

/* Cells in which no flow is left: inside of a body, all nodes rigid */
typedef struct {
  PetscInt n, capacity, *cell;
} InteriorCells;

/* Cells between two constrained surfaces, see PressureFindShared(), the first ncompressible, then inactive ones */
typedef struct {
  PetscReal eps, *block; /* [n][nk][nk] */
  PetscInt  n, ncompressible, capacity, *cell;
  PetscBool any; /* on any rank */
} GapCells;

/* Own cells near something that changes, each once */
typedef struct {
  PetscInt *stamp, stamp_now;   /* [ncell] */
  PetscInt  ntouched, *touched; /* with a body node, ascending */
  PetscInt  n, *cell;           /* scratch [ncell] */
} CellList;

/* Cells that are no part of the fluid */
typedef struct {
  const PetscInt *cell_material;
  PetscBool      *resolved; /* [nbodies] the mesh lines up with the body */
  PetscInt       *changed, nchanged, capacity;
} InactiveCells;

struct _p_Pressure {
  Flow             flow;
  Constraint       constraint;
  ContactCoupling  contact_coupling; /* NULL: none */
  MPI_Comm         comm;             /* of the mesh */
  Mesh             mesh;
  const MeshLocal *loc;
  PetscInt         nk, nr, nbodies; /* pressures a cell; rigid slots a body; bodies of all ranks */
  PetscReal        eps;
  PetscBool        single;   /* loose tolerance: products too, except at bodies */
  PetscBool        floating; /* pressure determined up to a constant without C */
  PetscBool        refresh;  /* cells have changed on some rank since the last update */
  MatNullSpace     constant;
  PetscReal       *weight; /* as of the last update; zero before the first */
  Coarse           coarse; /* of the default preconditioner, levels P1 discontinuous -> Q1; or NULL */
  NodesLevel       nodes;
  TwoLevelCycle    cycle;
  CutLevel         cut;
  InteriorCells    interior;
  GapCells         gap;
  CellList         list;
  InactiveCells    inactive;
  /* its cycle on a device (pressuredevice.c), NULL: none; rows have changed since */
  struct _p_PressureDevice *device;
  PetscBool                 device_stale;
  PetscReal                 device_changed; /* rows since its levels were made */
};

#define UNKNOWN -1 /* weight of a node whose cells have changed */

/* pressurematrix.c: the matrix with its pattern; then rows of cells with a node whose weight has changed, and of n more
   own cells, and the smoother. Collective. */
PetscErrorCode PressureCreateMatrix(Pressure);
PetscErrorCode PressureUpdateMatrix(Pressure, const PetscReal weight[], PetscInt n, const PetscInt changed[]);
/* A new list of own cells, each of which enters once. Not collective. */
void PressureStartList(Pressure);
void PressureListCellsOfNode(Pressure, PetscInt node);

/* pressurecut.c: cells touched by bodies, and among them those between two surfaces and inactive ones; then those
   inside of bodies, and pairs of cell and body where the body moves some nodes, but not all of them rigidly (a cell
   may meet two bodies). Not collective. */
PetscErrorCode PressureFindShared(Pressure);
/* Cells between two surfaces and inactive ones as they were; then the own cells whose part has changed since, the
   caller's to free, and the coarse operator with the new parts; frees old */
typedef struct {
  PetscInt   n, ncompressible, *cell;
  PetscReal *block;
} Shared;
PetscErrorCode PressureKeepShared(Pressure, Shared *old);
PetscErrorCode PressureChangeShared(Pressure, Shared *old, PetscInt *n, PetscInt *changed[]);
PetscErrorCode PressureFindInterior(Pressure);
PetscErrorCode PressureFindCut(Pressure, const PetscReal fraction[], const PetscReal mass_inverse[]);
/* y = matrix x + W W^T x = matrix x + sum_k (B R_k) M_k^{-1} (B R_k)^T x. Collective. */
PetscErrorCode PressureMult(Mat shell, Vec x, Vec y);

/* pressurecycle.c: turn the PCMG of the options into a cycle of our own, where they ask for nothing else.
   Collective. */
PetscErrorCode PressureTakeCycle(Pressure, PC);

/* Rows that are made on a device (devicemake.c); there, where nothing else is said */
typedef struct {
  double        *weight;   /* [nnode][3] of nodes; NULL: rows come from the host */
  int           *where;    /* [ncell] work */
  const int     *row, *at; /* of a call, as `block` [..][16] */
  double        *block;
  PetscInt      *own, used;     /* host: [ncell] place of a row's own, in blocks, or -1; blocks in use */
  PetscInt      *fresh, nfresh; /* host: rows whose inverses are to be made anew */
  unsigned char *listed;        /* host: [ncell] is a row among them? */
  size_t         capacity[3];
} RowsMade;

/* The cycle on a device, and what bodies have in it */
struct _p_PressureDevice {
  const DeviceQueue *queue;
  DevicePressure     cycle;
  size_t             capacity[8], room[5];
  int                ninterior, nshared; /* slots of cells inside of bodies; cells of GapCells */
  const int         *interior, *shared;
  double            *gap;      /* [nshared][4] */
  double            *constant; /* [ncell][4] a constant pressure */
  double            *noise;    /* [ncell][4] of find_largest */
  double            *sums;     /* [DEVICE_PARTIAL + 2] */
  DeviceSparse       lowest;   /* see DeviceLevelsCreate */
  PetscBool          keeps;    /* the matrix of the vertices, which the host has no more */
  PetscReal         *here;     /* several ranks: [ncell_all][4] on the host; [ncell][4] there, its correction; */
  double            *correction, *all; /* of products, with blocks of other ranks */
  RowsMade           made;
};

/* pressuredevice.c: is the cycle done on a device? In space. Its set-up, where rows have changed; z = cycle
   b; what it keeps. Collective. */
PetscBool      PressureIsOnDevice(Pressure);
PetscErrorCode PressureSetUpDevice(Pressure);
PetscErrorCode PressureApplyOnDevice(Pressure, Vec b, Vec z);
PetscErrorCode PressureDestroyDevice(Pressure);

/* devicecut.c: bodies of the step go over; y = S_p x in memory of the device, without its rows in between; what is
   kept; PressureMakeConsistent there; U [nlocal][nr] there = its sums over ranks, and what ties (NULL: none) make of
   them. Collective. */
PetscErrorCode PressureListBodiesOnDevice(Pressure);
PetscErrorCode PressureFreeBodiesOnDevice(Pressure);
PetscErrorCode PressureMultOnDevice(Pressure, Vec x, Vec y);
PetscErrorCode PressureMakeConsistentOnDevice(Pressure, PetscReal r[]);
PetscErrorCode PressureSumBodiesOnDevice(Pressure, ContactCoupling ties, PetscReal U[]);

/* devicemake.c: are rows made there? From the first set-up on, with bodies on one rank; n nodes have another weight,
   the listed cells other rows; inverses, when the bodies of the step are there. Not collective. */
PetscBool      PressureMakesRowsOnDevice(Pressure);
PetscErrorCode PressureBeginRowsOnDevice(Pressure);
PetscErrorCode PressureEndRowsOnDevice(Pressure);
PetscErrorCode PressureMakeRowsOnDevice(Pressure, const PetscReal weight[], PetscInt n, const PetscInt node[]);
PetscErrorCode PressureInvertRowsOnDevice(Pressure);

/* deviceranks.c: on several ranks, what the cycle has to do with the others. Not collective. */
PetscErrorCode PressureMeetRanks(Pressure);
PetscErrorCode PressureLeaveRanks(Pressure);
