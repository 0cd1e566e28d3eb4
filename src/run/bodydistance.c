/* BodyDistance: see bodydistance.h. */
#include "compat.h"
#include "bodydistance.h"
#include "base/array.h"
#include "bodies/local.h"

#define FEW 8 /* so many bodies need no grid */

/* ---- where they are ---- */

/* A body on its way */
typedef struct {
  PetscInt    number;
  PetscMPIInt owner;
  PetscBool   removed;
  PetscReal   X[3], q[4], u[3], scale;
} Record;

static Record record_of(const BodyDistance *s, PetscInt k)
{
  Record r = {.number = s->s->number[k], .removed = s->s->removed[k], .scale = s->s->scale[k]};

  (void)PetscArraycpy(r.X, s->X ? s->X[k] : s->s->x[k], 3);
  (void)PetscArraycpy(r.q, s->q ? s->q[k] : s->s->q[k], 4);
  (void)PetscArraycpy(r.u, s->u ? s->u[k] : s->s->u[k], 3);
  return r;
}

PetscErrorCode BodyDistanceFree(BodyDistance *s)
{
  PetscFunctionBeginUser;
  PetscCall(NearGridDestroy(&s->grid));
  PetscCall(PetscFree7(s->near_X, s->near_q, s->near_u, s->scale, s->removed, s->own, s->group));
  s->n = 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Own bodies whose surface is nearer than reach to a region of a rank go to it: near [*n], the caller's to free */
static PetscErrorCode exchange(const BodyDistance *s, RankBoxes regions, PetscReal reach, PetscInt *n, Record **near)
{
  PetscMPIInt *to, *from, rank;
  PetscInt     nown = 0, nout, *which, *body;
  PetscReal(*x)[3], *far;
  Record *out;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Comm_rank(s->comm, &rank));
  PetscCall(PetscMalloc3(s->s->n, &x, s->s->n, &far, s->s->n, &body));
  for (PetscInt k = 0; k < s->s->n; k++) {
    if (!s->s->own[k]) continue;
    PetscCall(PetscArraycpy(x[nown], s->X ? s->X[k] : s->s->x[k], 3));
    far[nown]    = reach + s->margin + BodiesGetRadius(s->s, k);
    body[nown++] = k;
  }
  PetscCall(RankBoxesSend(regions, nown, (const PetscReal(*)[3])x, far, &nout, &to, &which));
  PetscCall(PetscMalloc1(nout, &out));
  for (PetscInt i = 0; i < nout; i++) {
    out[i]       = record_of(s, body[which[i]]);
    out[i].owner = rank;
  }
  PetscCall(BodiesExchange(s->bodies, nout, to, sizeof(*out), out, n, near, &from));
  PetscCall(PetscFree3(x, far, body));
  PetscCall(PetscFree(to));
  PetscCall(PetscFree(from));
  PetscCall(PetscFree(which));
  PetscCall(PetscFree(out));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static int compare_numbers(const void *a, const void *b)
{
  const PetscInt x = ((const Record *)a)->number, y = ((const Record *)b)->number;

  return x < y ? -1 : x > y;
}

PetscErrorCode BodyDistanceGather(void *ctx, RankBoxes regions, PetscReal reach)
{
  BodyDistance *s = ctx;
  Record       *r;
  PetscInt      n = s->s->n;
  PetscMPIInt   rank;

  PetscFunctionBeginUser;
  PetscCall(BodyDistanceFree(s));
  PetscCallMPI(MPI_Comm_rank(s->comm, &rank));
  if (BodiesComm(s->bodies) == PETSC_COMM_SELF) {
    PetscCall(PetscMalloc1(n, &r));
    for (PetscInt k = 0; k < n; k++) r[k] = record_of(s, k);
  } else PetscCall(exchange(s, regions, reach, &n, &r));
  qsort(r, (size_t)n, sizeof(*r), compare_numbers);
  PetscCall(
    PetscMalloc7(n, &s->near_X, n, &s->near_q, n, &s->near_u, n, &s->scale, n, &s->removed, n, &s->own, n, &s->group));
  for (PetscInt k = 0, g = 0; k < n; k++) {
    while (s->s->group[g].first + s->s->group[g].count <= r[k].number) g++;
    PetscCall(PetscArraycpy(s->near_X[k], r[k].X, 3));
    PetscCall(PetscArraycpy(s->near_q[k], r[k].q, 4));
    PetscCall(PetscArraycpy(s->near_u[k], r[k].u, 3));
    s->scale[k]   = r[k].scale;
    s->removed[k] = r[k].removed;
    s->own[k]     = (PetscBool)(r[k].owner == rank);
    s->group[k]   = g;
  }
  PetscCall(PetscFree(r));
  s->n = n;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscReal radius_of(const BodyDistance *s, PetscInt k)
{
  return s->scale[k] * s->s->group[s->group[k]].radius;
}

/* ---- how far from them ---- */

/* Elastic ones come after the rigid ones */
static PetscErrorCode create_grid(BodyDistance *s)
{
  const PetscInt n = BodyDistanceCount(s);
  PetscReal     *half;
  PetscReal(*X)[3];

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc2(n, &half, n, &X));
  PetscCall(PetscArraycpy((PetscReal *)X, (const PetscReal *)s->near_X, 3 * s->n));
  for (PetscInt k = 0; k < s->n; k++) half[k] = s->removed[k] ? -1 : radius_of(s, k) + s->margin;
  for (PetscInt k = s->n; k < n; k++) {
    PetscCall(PetscArraycpy(X[k], s->solids->centre[k - s->n], 3));
    half[k] = s->solids->radius[k - s->n] + s->margin;
  }
  PetscCall(NearGridCreate(s->dim, s->lower, s->upper, s->period, n, (const PetscReal(*)[3])X, half, &s->grid));
  PetscCall(PetscFree2(half, X));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* *d becomes the distance to body k, looked at closely only within reach, if that is less */
static PetscErrorCode try_body(const BodyDistance *s, PetscInt k, const PetscReal x[3], PetscReal reach, PetscReal *d)
{
  const PetscInt   e      = k - s->n; /* >= 0: an elastic one */
  const PetscReal *X      = e < 0 ? s->near_X[k] : s->solids->centre[e];
  const PetscReal  radius = e < 0 ? radius_of(s, k) : s->solids->radius[e];
  PetscReal        y[3] = {0, 0, 0}, r = 0, at;

  PetscFunctionBeginUser;
  for (PetscInt a = 0; a < s->dim; a++) {
    y[a] = DomainNearest(s->period[a], x[a], X[a]);
    r += PetscSqr(y[a] - X[a]);
  }
  r = PetscSqrtReal(r) - radius - s->margin;
  if ((e < 0 && s->removed[k]) || r > reach || r > *d) PetscFunctionReturn(PETSC_SUCCESS);
  if (e < 0) PetscCall(BodiesDistanceOf(s->bodies, s->group[k], s->scale[k], X, s->near_q[k], 1, y, &at));
  else PetscCall((*s->solids->distance)(s->solids->ctx, e, X, 1, y, &at));
  *d = PetscMin(*d, s->inside ? PetscMax(at - s->margin, 0) : PetscAbsReal(at));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodyDistanceAt(void *ctx, const PetscReal x[3], PetscReal reach, PetscReal *d)
{
  BodyDistance  *s = ctx;
  const PetscInt n = BodyDistanceCount(s), *body;
  Grid           grid;

  PetscFunctionBeginUser;
  *d = PETSC_MAX_REAL;
  if (s->drops) PetscCall(DropDistanceAt(s->drops, x, reach, s->margin, d));
  if (n <= FEW) {
    for (PetscInt k = 0; k < n; k++) PetscCall(try_body(s, k, x, reach, d));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  if (!s->grid) PetscCall(create_grid(s));
  PetscCall(NearGridGet(s->grid, reach, &grid, &body));
  for (PetscInt e = GridFirst(grid, x); e >= 0 && *d > 0; e = GridNext(grid, e))
    PetscCall(try_body(s, body[GridItem(grid, e)], x, reach, d));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodyDistanceWakeBoxes(void *ctx, const char group[], PetscBool motion, MeshCarriers *c)
{
  const BodyDistance *s = ctx;
  PetscBool           same;

  PetscFunctionBeginUser;
  for (PetscInt g = 0; g < s->s->ngroups; g++) {
    const BodyGroup *of    = s->s->group + g;
    PetscInt         first = 0, n = 0;

    PetscCall(PetscStrcmp(of->name, group, &same));
    if (!same) continue;
    PetscCheck(!motion || of->free || of->motion.given, s->comm, PETSC_ERR_USER_INPUT,
               "A box of -mesh_refine lies against the motion of group '%s', which stands still: put -mesh_box_<box>_orientation axes",
               group);
    while (first < s->n && s->group[first] < g) first++;
    while (first + n < s->n && s->group[first + n] == g) n++;
    *c = (MeshCarriers){.n = n};
    if (n)
      *c = (MeshCarriers){.n       = n,
                          .x       = s->near_X + first,
                          .u       = s->near_u + first,
                          .removed = s->removed + first,
                          .own     = s->own + first};
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}
