/* Snap, thin bodies. In space no cell has its middle in a plate thinner than a cell, and there is no surface of faces
   that takes the place of the plane's path of edges, for which all ranks are to know the body (path.c). */
#include "compat.h"
#include "base/agree.h"
#include "impl.h"
#include "bodies/local.h"

#define WIDE 3    /* from how many cells on a body thinner than one is a plate */
#define FINE 0.05 /* how exactly thickness is measured, cell sizes */

/* Largest depth in body k, or more than enough: cubes in which there may be a deeper point are halved. The distance
   changes by no more than the way. */
static PetscErrorCode find_deepest(Snap s, PetscInt k, const PetscReal x[3], PetscReal half, PetscReal enough, PetscReal *depth)
{
  PetscReal d;

  PetscFunctionBeginUser;
  PetscCall(BodiesDistance(s->bodies, k, s->state->x[k], s->state->q[k], 1, x, &d));
  *depth = PetscMax(*depth, -d);
  if (*depth >= enough || half < FINE * enough || PetscSqrtReal(3) * half - d <= *depth) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt v = 0; v < 8; v++) {
    PetscReal y[3];

    for (PetscInt a = 0; a < 3; a++) y[a] = x[a] + (v >> a & 1 ? 0.5 : -0.5) * half;
    PetscCall(find_deepest(s, k, y, 0.5 * half, enough, depth));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Size of the smallest body of a group, on any rank */
static PetscErrorCode find_least(Bodies bodies, const BodyState *s, PetscInt group, PetscReal *least)
{
  PetscFunctionBeginUser;
  *least = PETSC_MAX_REAL;
  for (PetscInt k = 0; k < s->n; k++)
    if (s->body_group[k] == group) *least = PetscMin(*least, s->scale[k]);
  PetscCall(BodiesMin(bodies, 1, least));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The smallest body of a group, if it is known here. Its size is `least`. */
static PetscErrorCode refuse_plate(Snap s, const BodyGroup *group, PetscReal least)
{
  const PetscReal h     = s->loc->h;
  PetscInt        k     = -1;
  PetscReal       depth = 0;

  PetscFunctionBeginUser;
  for (PetscInt j = 0; j < s->nbodies && k < 0; j++)
    if (BodiesGetGroup(s->state, j) == group && s->state->scale[j] == least) k = j;
  if (k < 0 || 2 * BodiesGetRadius(s->state, k) < WIDE * h) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(find_deepest(s, k, s->state->x[k], BodiesGetRadius(s->state, k), 0.5 * h, &depth));
  PetscCheck(depth >= 0.5 * h, s->nbodies < s->state->nall ? PETSC_COMM_SELF : PETSC_COMM_WORLD, PETSC_ERR_SUP,
             "Group '%s' has bodies that are %.2g thick, thinner than a cell (%.2g), and wider than %d cells: -couple_method aligned follows such "
             "plates in the plane only. Use smaller cells (-mesh_cells, at most %.2g), a thicker body, or -couple_method penalty",
             group->name, (double)(2 * depth), (double)h, WIDE, (double)(2 * depth));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SnapRefusePlates(Snap s)
{
  PetscFunctionBeginUser;
  for (PetscInt g = 0; g < s->state->ngroups; g++) {
    const BodyGroup *group = &s->state->group[g];
    PetscReal        least;

    if (group->hole || !group->count) continue;
    PetscCall(find_least(s->bodies, s->state, g, &least));
    AgreeEnter();
    PetscCall(AgreeLeave(refuse_plate(s, group, least)));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- in the plane ---- */

/* Root of the area of the largest cell, or more */
static PetscErrorCode find_largest_cell(Mesh mesh, PetscReal *size)
{
  const MeshLocal *l;

  PetscFunctionBeginUser;
  PetscCall(MeshGetLocal(mesh, &l));
  *size = 0;
  for (PetscInt c = 0; c < l->ncell; c++) {
    PetscReal x[MESH_MAX_NB * 3], area = 1;

    PetscCall(MeshCellCoordinates(mesh, c, x));
    for (PetscInt a = 0; a < 2; a++) {
      PetscReal lower = x[a], upper = x[a];

      for (PetscInt j = 1; j < l->nb; j++) {
        lower = PetscMin(lower, x[2 * j + a]);
        upper = PetscMax(upper, x[2 * j + a]);
      }
      area *= upper - lower;
    }
    *size = PetscMax(*size, PetscSqrtReal(area));
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, size, 1, MPIU_REAL, MPIU_MAX, PETSC_COMM_WORLD));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SnapSpreadThin(Mesh mesh, Bodies bodies)
{
  BodyState *s;
  PetscReal  cell;

  PetscFunctionBeginUser;
  PetscCall(BodiesGetState(bodies, &s));
  if (s->dim == 3) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(find_largest_cell(mesh, &cell));
  for (PetscInt i = 0; i < s->ngroups; i++) {
    const BodyGroup *g         = &s->group[i];
    Midline          line      = NULL;
    PetscReal        thickness = PETSC_MAX_REAL, least;

    if (!g->hole && g->count) PetscCall(MidlineCreate(g->shape, &line));
    if (!line) continue;
    PetscCall(MidlineGetSize(line, NULL, &thickness));
    PetscCall(MidlineDestroy(&line));
    PetscCall(find_least(bodies, s, i, &least));
    if (least * thickness < THIN * cell) PetscCall(BodiesSetEverywhere(bodies, i));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}
