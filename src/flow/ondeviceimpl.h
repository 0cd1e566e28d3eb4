/* Inside of OnDevice, for its files only. */
#pragma once
#include "flow/device.h"
#include "impl.h"

/* Fields of the flow as the device has them; nodal [nnode][3], by cells [ncell][4] */
typedef struct {
  PetscBool allowed, stays;          /* can fields stay there in this scene; do they in this step? */
  PetscBool here, there;             /* are u, u_old, p, p_old up to date on the host, on the device? */
  PetscBool w_here, w_there;         /* w */
  PetscBool u_new_here;              /* the solution, on the host */
  double   *u, *u_old, *p, *p_old;   /* as the flow has them */
  double   *u_new, *p_new, *dp;      /* start value, then solution of the step; last change of the pressure */
  double   *rhs, *source;            /* right-hand side; body force that varies, or NULL */
  double   *work, *cell;             /* [nnode][3], [ncell][4] */
  double   *partial, *out;           /* of reductions: [DEVICE_PARTIAL], [4] */
  double   *lumped, *size, *inverse; /* [nnode]; squares of the cells' sizes and of their inverses, [ncell] */
  double   *inverse_volume;          /* [ncell][4] of the constant pressure, else 0 */
  double   *centre;                  /* [ncell][4] middle, from the lower corner of the domain, and size; NULL so far */
  size_t    nodal, pressures; /* numbers of such arrays: of the cells that they were made for, while the mesh changes */
  PetscReal volume;
} DeviceFields;

/* Terms of participants in cells (FlowDescribeCellTerms), in groups */
typedef struct {
  DeviceMoments on;
  size_t        capacity[6];
  int          *place; /* of moments that are drawn there, and what from */
  DeviceBall   *ball;
} MomentsOnDevice;

/* Rows on their way: FlowFetchRows and others */
typedef struct {
  const int *row;
  double    *value;
  size_t     capacity[2];
  PetscReal *here; /* on the host, for as many numbers as `value` */
} RowsOnDevice;

struct _p_OnDevice {
  DeviceQueue      queue;
  DeviceTraffic    traffic, before; /* all, and until the step before */
  DeviceCells      cells;
  DeviceForm       form;
  DeviceDivergence divergence;
  const int       *place;       /* [ncell] of cells in groups; NULL so far */
  int             *place_here;  /* the same on the host */
  PetscInt        *hang;        /* [MESH_HANG_CODES] number of a way to hang; NULL: nothing hangs */
  double          *w;           /* [nnode_all][3] convecting velocity */
  double          *from, *to;   /* [nnode_all][3] with ghosts, where there are some */
  double          *coefficient; /* at the points, see DeviceCoefficients */
  size_t           capacity;    /* of those */
  MomentsOnDevice  moments;
  DeviceFields     field;
  RowsOnDevice     rows;
  DeviceCounts    *counts; /* -device_table, or NULL */
  PetscBool        left;   /* FlowLeaveDevice */
};

/* Cells with the operator of a step, all or some */
typedef struct {
  const DeviceCells *cells;
  const DeviceForm  *form;
  const double      *coefficient;
  size_t             n; /* numbers of nodal arrays */
} DeviceTerms;

/* rhs = what is known of the time before and forces: mass times d and forces over rho, less (1 - theta) of the other
   terms, of which S has theta times. u, u_old, source (or NULL): nodal arrays of these cells; work [n]. Local. */
PetscErrorCode DeviceAddPast(Flow, const DeviceTerms *, const double u[], const double u_old[], const double source[],
                             double work[], double rhs[]);
/* Coefficients of the step's operator in cells, for w there; memory of the device, which grows to what they need.
   Local. */
PetscErrorCode DeviceSetCoefficients(OnDevice, const DeviceCells *, const double w[], double **coefficient,
                                     size_t *capacity);
/* Terms of participants of the step (devicemoments.c). Local. */
PetscErrorCode DeviceMomentsUpdate(Flow, OnDevice);
PetscErrorCode DeviceMomentsDestroy(OnDevice);
/* The number on the device of the way in which nodes of an own cell hang, or -1 */
static inline int OnDeviceFindHang(const struct _p_Flow *f, PetscInt cell)
{
  const MeshHang *h = MeshCellHang(f->loc, cell);

  return h ? (int)f->device->hang[h->code] : -1;
}
/* o->place and o->place_here. Local. */
PetscErrorCode OnDeviceFindGroups(OnDevice);
/* Of rows on their way (devicefetch.c). Local. */
PetscErrorCode DeviceFetchDestroy(OnDevice);
/* -device_table: begin to count; the table, and the end of it. Collective. */
PetscErrorCode DeviceTableCreate(OnDevice);
PetscErrorCode DeviceTableDestroy(OnDevice);
/* Memory of the fields, and what belongs to the cells. Local. */
PetscErrorCode DeviceFieldsCreate(Flow, OnDevice);
PetscErrorCode DeviceFieldsDestroy(OnDevice);
/* Fields of the device are up to date afterwards. Local. */
PetscErrorCode DeviceFieldsSend(Flow, OnDevice);

static inline size_t DeviceNodal(Flow f)
{
  return (size_t)f->loc->nnode * 3;
}

static inline size_t DevicePressures(Flow f)
{
  return (size_t)f->loc->ncell * 4;
}
