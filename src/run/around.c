/* Around: see around.h. */
#include "compat.h"
#include "around.h"
#include "base/room.h"
#include "bodies/local.h"
#include <math.h>

#define FEW 8 /* so many bodies need no grid */
/* ---- where they are ---- */

/* A body on its way */
typedef struct {
  PetscInt    number;
  PetscMPIInt owner;
  PetscBool   gone;
  PetscReal   X[3], q[4], u[3], scale;
} Record;

static Record record_of(const Around *s, PetscInt k)
{
  Record r = {.number = s->s->number[k], .gone = s->s->gone[k], .scale = s->s->scale[k]};

  (void)PetscArraycpy(r.X, s->X ? s->X[k] : s->s->x[k], 3);
  (void)PetscArraycpy(r.q, s->q ? s->q[k] : s->s->q[k], 4);
  (void)PetscArraycpy(r.u, s->u ? s->u[k] : s->s->u[k], 3);
  return r;
}

/* Grids of bodies that are no longer there */
static PetscErrorCode forget(Around *s)
{
  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < s->ngrid; i++) {
    PetscCall(GridDestroy(&s->grid[i]));
    PetscCall(PetscFree(s->body[i]));
  }
  s->ngrid = 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AroundDrop(Around *s)
{
  PetscFunctionBeginUser;
  PetscCall(forget(s));
  PetscCall(PetscFree7(s->near_X, s->near_q, s->near_u, s->scale, s->gone, s->own, s->group));
  s->n = 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Own bodies whose surface is nearer than reach to a region of a rank go to it: near [*n], the caller's to free */
static PetscErrorCode exchange(const Around *s, Regions regions, PetscReal reach, PetscInt *n, Record **near)
{
  PetscMPIInt *to   = NULL, *from, rank;
  PetscInt     nout = 0, room = 0, *which = NULL;
  Record      *out;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Comm_rank(PETSC_COMM_WORLD, &rank));
  for (PetscInt k = 0; k < s->s->n; k++) {
    const PetscMPIInt *answer;
    PetscInt           m;

    if (!s->s->own[k]) continue;
    PetscCall(RegionsNear(regions, s->X ? s->X[k] : s->s->x[k], reach + s->margin + BodiesGetRadius(s->s, k), &m, &answer));
    PetscCall(RoomFor(nout + m, &room, &to, sizeof(*to), &which, sizeof(*which), NULL));
    for (PetscInt i = 0; i < m; i++) {
      to[nout]      = answer[i];
      which[nout++] = k;
    }
  }
  PetscCall(PetscSortMPIIntWithIntArray((PetscMPIInt)nout, to, which));
  PetscCall(PetscMalloc1(nout, &out));
  for (PetscInt i = 0; i < nout; i++) {
    out[i]       = record_of(s, which[i]);
    out[i].owner = rank;
  }
  PetscCall(BodiesExchange(s->bodies, nout, to, sizeof(*out), out, n, near, &from));
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

PetscErrorCode AroundLook(void *around, Regions regions, PetscReal reach)
{
  Around     *s = around;
  Record     *r;
  PetscInt    n = s->s->n;
  PetscMPIInt rank;

  PetscFunctionBeginUser;
  PetscCall(AroundDrop(s));
  PetscCallMPI(MPI_Comm_rank(PETSC_COMM_WORLD, &rank));
  if (BodiesComm(s->bodies) == PETSC_COMM_SELF) {
    PetscCall(PetscMalloc1(n, &r));
    for (PetscInt k = 0; k < n; k++) r[k] = record_of(s, k);
  } else PetscCall(exchange(s, regions, reach, &n, &r));
  qsort(r, (size_t)n, sizeof(*r), compare_numbers);
  PetscCall(PetscMalloc7(n, &s->near_X, n, &s->near_q, n, &s->near_u, n, &s->scale, n, &s->gone, n, &s->own, n, &s->group));
  for (PetscInt k = 0, g = 0; k < n; k++) {
    while (s->s->group[g].first + s->s->group[g].count <= r[k].number) g++;
    PetscCall(PetscArraycpy(s->near_X[k], r[k].X, 3));
    PetscCall(PetscArraycpy(s->near_q[k], r[k].q, 4));
    PetscCall(PetscArraycpy(s->near_u[k], r[k].u, 3));
    s->scale[k] = r[k].scale;
    s->gone[k]  = r[k].gone;
    s->own[k]   = (PetscBool)(r[k].owner == rank);
    s->group[k] = g;
  }
  PetscCall(PetscFree(r));
  s->n = n;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscReal radius_of(const Around *s, PetscInt k)
{
  return s->scale[k] * s->s->group[s->group[k]].radius;
}

/* ---- how far from them ---- */

/* Bodies and their images whose boxes, larger by `reach`, meet the domain */
static PetscErrorCode fill_grid(const Around *s, PetscReal reach, Grid *grid, PetscInt **body)
{
  PetscInt  n = 0, room = 0;
  PetscReal mean = 0;

  PetscFunctionBeginUser;
  *body = NULL;
  for (PetscInt k = 0; k < s->n; k++) mean += radius_of(s, k) / (PetscReal)s->n;
  PetscCall(GridCreate(s->dim, s->lower, s->upper, 2 * (mean + s->margin + reach), 8 * s->n, grid));
  for (PetscInt k = 0; k < s->n; k++) {
    const PetscReal half = radius_of(s, k) + s->margin + reach;

    if (s->gone[k]) continue;
    for (DomainImages i = {0}; DomainNextImage(s->period, s->lower, s->upper, s->near_X[k], half, &i);) {
      PetscCall(RoomFor(n + 1, &room, body, sizeof(**body), NULL));
      (*body)[n] = k;
      PetscCall(GridInsert(*grid, n++, i.at, half));
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The grid for a reach, by its number */
static PetscErrorCode find_grid(Around *s, PetscReal reach, PetscInt *number)
{
  int power;

  PetscFunctionBeginUser;
  (void)frexp(reach, &power); /* reach <= 2^power */
  for (*number = 0; *number < s->ngrid && s->power[*number] != power; (*number)++) {}
  if (*number < s->ngrid) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCheck(s->ngrid < AROUND_GRIDS, PETSC_COMM_SELF, PETSC_ERR_PLIB, "Distances to bodies are asked for with too many reaches");
  PetscCall(fill_grid(s, ldexp(1, power), &s->grid[s->ngrid], &s->body[s->ngrid]));
  s->power[s->ngrid++] = power;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* *d becomes the distance to body k, looked at closely only within reach, if that is less */
static PetscErrorCode try_body(const Around *s, PetscInt k, const PetscReal x[3], PetscReal reach, PetscReal *d)
{
  PetscReal y[3] = {0, 0, 0}, r = 0, at;

  PetscFunctionBeginUser;
  for (PetscInt a = 0; a < s->dim; a++) {
    y[a] = DomainNearest(s->period[a], x[a], s->near_X[k][a]);
    r += PetscSqr(y[a] - s->near_X[k][a]);
  }
  r = PetscSqrtReal(r) - radius_of(s, k) - s->margin;
  if (s->gone[k] || r > reach || r > *d) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(BodiesDistanceOf(s->bodies, s->group[k], s->scale[k], s->near_X[k], s->near_q[k], 1, y, &at));
  *d = PetscMin(*d, s->inside ? PetscMax(at - s->margin, 0) : PetscAbsReal(at));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AroundDistance(void *around, const PetscReal x[3], PetscReal reach, PetscReal *d)
{
  Around  *s = around;
  PetscInt number;

  PetscFunctionBeginUser;
  *d = PETSC_MAX_REAL;
  if (s->n <= FEW) {
    for (PetscInt k = 0; k < s->n; k++) PetscCall(try_body(s, k, x, reach, d));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(find_grid(s, reach, &number));
  for (PetscInt e = GridFirst(s->grid[number], x); e >= 0 && *d > 0; e = GridNext(s->grid[number], e))
    PetscCall(try_body(s, s->body[number][GridItem(s->grid[number], e)], x, reach, d));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AroundCarriers(void *around, const char group[], PetscBool motion, MeshCarriers *c)
{
  const Around *s = around;
  PetscBool     same;

  PetscFunctionBeginUser;
  for (PetscInt g = 0; g < s->s->ngroups; g++) {
    const BodyGroup *of    = s->s->group + g;
    PetscInt         first = 0, n = 0;

    PetscCall(PetscStrcmp(of->name, group, &same));
    if (!same) continue;
    PetscCheck(!motion || of->free || of->motion.given, PETSC_COMM_WORLD, PETSC_ERR_USER_INPUT,
               "A box of -mesh_refine lies against the motion of group '%s', which stands still: put -mesh_box_<box>_along axes", group);
    while (first < s->n && s->group[first] < g) first++;
    while (first + n < s->n && s->group[first + n] == g) n++;
    *c = (MeshCarriers){.n = n};
    if (n) *c = (MeshCarriers){.n = n, .x = s->near_X + first, .u = s->near_u + first, .gone = s->gone + first, .own = s->own + first};
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}
