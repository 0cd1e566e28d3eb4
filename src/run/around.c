/* Around: see around.h. */
#include "compat.h"
#include "around.h"
#include "base/parcels.h"
#include "base/room.h"
#include "bodies/local.h"
#include <math.h>

#define FEW    8  /* so many bodies need no grid */
#define RECORD 12 /* numbers of a body: place, orientation, velocity, size, has it left? */

/* ---- where they are ---- */

/* *all [nall][RECORD] by numbers, from known [n][RECORD] */
static PetscErrorCode gather(const Around *s, const PetscReal known[], PetscReal **all)
{
  const size_t bytes = RECORD * sizeof(PetscReal);
  BodyRows     rows;
  PetscReal   *row;
  PetscInt     n = s->s->n;

  PetscFunctionBeginUser;
  if (BodiesComm(s->bodies) == PETSC_COMM_SELF) {
    PetscCall(PetscMalloc1(RECORD * n, all));
    PetscCall(PetscArraycpy(*all, known, RECORD * n));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(BodiesBeginRows(s->bodies, &rows));
  PetscCall(PetscMalloc1(RECORD * rows.n, &row));
  PetscCall(BodiesGatherRows(s->bodies, &rows, bytes, known, row));
  PetscCall(ParcelsGather(PETSC_COMM_WORLD, rows.n, bytes, row, &n, all, NULL));
  PetscCall(PetscFree(row));
  PetscCall(BodiesEndRows(&rows));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AroundDrop(Around *s)
{
  PetscFunctionBeginUser;
  PetscCall(AroundForget(s));
  PetscCall(PetscFree6(s->X, s->q, s->u, s->scale, s->gone, s->group));
  s->n = 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AroundCollect(Around *s, const PetscReal (*X)[3], const PetscReal (*q)[4], const PetscReal (*u)[3])
{
  const PetscInt n = s->s->nall;
  PetscReal     *known, *all;

  PetscFunctionBeginUser;
  PetscCall(AroundDrop(s));
  PetscCall(PetscMalloc1(RECORD * s->s->n, &known));
  for (PetscInt k = 0; k < s->s->n; k++) {
    PetscReal *r = known + RECORD * k;

    PetscCall(PetscArraycpy(r, X[k], 3));
    PetscCall(PetscArraycpy(r + 3, q[k], 4));
    PetscCall(PetscArraycpy(r + 7, u[k], 3));
    r[10] = s->s->scale[k];
    r[11] = s->s->gone[k];
  }
  PetscCall(gather(s, known, &all));
  PetscCall(PetscMalloc6(n, &s->X, n, &s->q, n, &s->u, n, &s->scale, n, &s->gone, n, &s->group));
  for (PetscInt k = 0, g = 0; k < n; k++) {
    const PetscReal *r = all + RECORD * k;

    while (s->s->group[g].first + s->s->group[g].count <= k) g++;
    PetscCall(PetscArraycpy(s->X[k], r, 3));
    PetscCall(PetscArraycpy(s->q[k], r + 3, 4));
    PetscCall(PetscArraycpy(s->u[k], r + 7, 3));
    s->scale[k] = r[10];
    s->gone[k]  = (PetscBool)(r[11] != 0);
    s->group[k] = g;
  }
  PetscCall(PetscFree(known));
  PetscCall(PetscFree(all));
  s->n = n;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscReal radius_of(const Around *s, PetscInt k)
{
  return s->scale[k] * s->s->group[s->group[k]].radius;
}

/* ---- how far from them ---- */

PetscErrorCode AroundForget(Around *s)
{
  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < s->ngrid; i++) {
    PetscCall(GridDestroy(&s->grid[i]));
    PetscCall(PetscFree(s->body[i]));
  }
  s->ngrid = 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}

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
    for (DomainImages i = {0}; DomainNextImage(s->period, s->lower, s->upper, s->X[k], half, &i);) {
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
    y[a] = DomainNearest(s->period[a], x[a], s->X[k][a]);
    r += PetscSqr(y[a] - s->X[k][a]);
  }
  r = PetscSqrtReal(r) - radius_of(s, k) - s->margin;
  if (s->gone[k] || r > reach || r > *d) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(BodiesDistanceOf(s->bodies, s->group[k], s->scale[k], s->X[k], s->q[k], 1, y, &at));
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
    const BodyGroup *of = s->s->group + g;

    PetscCall(PetscStrcmp(of->name, group, &same));
    if (!same) continue;
    PetscCheck(!motion || of->free || of->motion.given, PETSC_COMM_WORLD, PETSC_ERR_USER_INPUT,
               "A box of -mesh_refine lies against the motion of group '%s', which stands still: put -mesh_box_<box>_along axes", group);
    *c = (MeshCarriers){.n = of->count, .x = s->X + of->first, .u = s->u + of->first, .gone = s->gone + of->first};
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}
