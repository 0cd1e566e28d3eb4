/* Boxes: see boxes.h. */
#include "compat.h"
#include "base/runcomm.h"
#include "boxes.h"
#include "../kinds/kindimpl.h"
#include "base/algebra.h"
#include "base/opt.h"
#include "base/array.h"

#define SLOPE 3 /* by which levels fall off beside a box */

static const char *const ALONG[] = {"axes", "velocity", NULL};

PetscErrorCode BoxesReadNames(BoxesNames *s)
{
  PetscInt  n                    = BOXES_MAX + 1;
  char     *names[BOXES_MAX + 1] = {NULL}, option[OPT_NAME];
  PetscBool given;

  PetscFunctionBeginUser;
  PetscCall(OptHas("-mesh_refine", &given));
  PetscCall(OptStringArray("-mesh_refine", &n, names));
  *s = (BoxesNames){.bodies = (PetscBool)!given};
  for (PetscInt i = 0; i < n; i++) {
    PetscBool same, formula;

    PetscCall(PetscStrcmp(names[i], "bodies", &same));
    PetscCall(PetscStrcmp(names[i], "expression", &formula));
    PetscCheck(same || formula || s->nbox < BOXES_MAX, RunComm(), PETSC_ERR_USER_INPUT,
               "-mesh_refine names more than %d boxes: leave out some", BOXES_MAX);
    if (same) s->bodies = PETSC_TRUE;
    else if (formula) s->expression = PETSC_TRUE;
    else {
      PetscCall(PetscStrncpy(s->box[s->nbox], names[i], BOXES_NAME));
      PetscCall(OptString(OptJoin("-mesh_box_", names[i], "_group", option), s->group[s->nbox], BOXES_NAME));
      s->carried = (PetscBool)(s->carried || s->group[s->nbox][0]);
      s->nbox++;
    }
    PetscCall(PetscFree(names[i]));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Directions of the sides of a box whose first axis points against u; in space the second one is square to the axis of
   the domain that is least along u */
static void point_against(PetscInt dim, const PetscReal u[3], PetscReal speed, PetscReal axis[3][3])
{
  PetscReal along[3] = {0, 0, 1}, size;
  PetscInt  min      = 0;

  for (PetscInt d = 0; d < 3; d++) axis[0][d] = d < dim ? -u[d] / speed : 0;
  if (dim == 3) {
    for (PetscInt d = 1; d < 3; d++)
      if (PetscAbsReal(u[d]) < PetscAbsReal(u[min])) min = d;
    for (PetscInt d = 0; d < 3; d++) along[d] = d == min;
  }
  cross(along, axis[0], axis[1]);
  size = PetscSqrtReal(dot3(axis[1], axis[1]));
  for (PetscInt d = 0; d < 3; d++) axis[1][d] /= size;
  cross(axis[0], axis[1], axis[2]);
}

/* The box and its images one period to either side */
static PetscErrorCode add_images(Boxes *s, MeshKind kind, const MeshBox *box)
{
  PetscFunctionBeginUser;
  for (DomainImages i = {0};
       DomainNextImage(kind->period, kind->lower, kind->upper, box->origin, PETSC_MAX_REAL / 4, &i);) {
    PetscCall(ArrayReserve(s->n + 1, &s->capacity, &s->box, sizeof(*s->box), NULL));
    s->box[s->n] = *box;
    PetscCall(PetscArraycpy(s->box[s->n++].origin, i.at, 3));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* One box for every body of the group that is there and, where it shall point against their motion, moves */
static PetscErrorCode add_carried(Boxes *s, MeshKind kind, const MeshSurface *surface, PetscInt which)
{
  const char *const group  = s->names.group[which];
  const PetscBool   motion = s->motion[which];
  const PetscInt    dim    = kind->dim;
  MeshCarriers      c      = {.n = -1};

  PetscFunctionBeginUser;
  if (surface && surface->carriers) PetscCall((*surface->carriers)(surface->context, group, motion, &c));
  PetscCheck(c.n >= 0, kind->comm, PETSC_ERR_USER_INPUT,
             "-mesh_box_%s_group: the scene has no group '%s': name one of -particle_groups", s->names.box[which],
             group);
  for (PetscInt i = 0; i < c.n; i++) {
    MeshBox   mine  = s->given[which];
    PetscReal speed = 0;

    for (PetscInt d = 0; d < dim; d++) speed += PetscSqr(c.u[i][d]);
    if (c.removed[i] || (motion && speed == 0)) continue;
    if (motion) point_against(dim, c.u[i], PetscSqrtReal(speed), mine.axis);
    PetscCall(PetscArraycpy(mine.origin, c.x[i], dim));
    PetscCall(add_images(s, kind, &mine));
    s->carried += c.own[i];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode read_corners(MPI_Comm comm, PetscInt dim, PetscInt levels, const char name[], MeshBox *b)
{
  char      option[OPT_NAME];
  PetscReal corner[6];
  PetscBool given;

  PetscFunctionBeginUser;
  *b = (MeshBox){.axis = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, .levels = levels};
  PetscCall(OptRealArray(OptJoin("-mesh_box_", name, "_corners", option), 2 * dim, corner, &given));
  PetscCheck(given, comm, PETSC_ERR_USER_INPUT,
             "-mesh_refine names a box '%s' that nobody gave: give its lower and upper corner by %s", name, option);
  for (PetscInt d = 0; d < dim; d++) {
    b->lower[d] = corner[d];
    b->upper[d] = corner[dim + d];
    PetscCheck(b->upper[d] > b->lower[d], comm, PETSC_ERR_USER_INPUT, "%s: [%g, %g] along axis %c is empty", option,
               (double)b->lower[d], (double)b->upper[d], (char)('x' + d));
  }
  PetscCall(OptInt(OptJoin("-mesh_box_", name, "_levels", option), &b->levels));
  PetscCheck(b->levels <= levels, comm, PETSC_ERR_USER_INPUT,
             "%s %" PetscInt_FMT " is more than -mesh_levels %" PetscInt_FMT, option, b->levels, levels);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BoxesRead(MPI_Comm comm, PetscInt dim, PetscInt levels, Boxes *s)
{
  PetscFunctionBeginUser;
  *s = (Boxes){0};
  PetscCall(BoxesReadNames(&s->names));
  for (PetscInt i = 0; i < s->names.nbox; i++) {
    const char *name = s->names.box[i], *group = s->names.group[i];
    char        along[OPT_NAME];
    PetscInt    which = 0;
    PetscBool   given;

    PetscCall(read_corners(comm, dim, levels, name, s->given + i));
    PetscCall(OptHas(OptJoin("-mesh_box_", name, "_orientation", along), &given));
    PetscCall(OptChoice(along, ALONG, &which));
    PetscCheck(group[0] || !given, comm, PETSC_ERR_USER_INPUT,
               "%s is for boxes that go with bodies: name their group by -mesh_box_%s_group, or remove it", along,
               name);
    s->motion[i] = (PetscBool)(which == 1);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscReal BoxesReach(const Boxes *s, PetscReal h)
{
  PetscReal reach = 0;

  for (PetscInt i = 0; i < s->names.nbox; i++) {
    const MeshBox *b      = s->given + i;
    PetscReal      corner = 0;

    for (PetscInt a = 0; a < 3; a++) corner += PetscSqr(PetscMax(PetscAbsReal(b->lower[a]), PetscAbsReal(b->upper[a])));
    if (s->names.group[i][0]) reach = PetscMax(reach, PetscSqrtReal(corner) + SLOPE * h);
  }
  return reach;
}

PetscErrorCode BoxesPlace(Boxes *s, MeshKind kind, const MeshSurface *surface)
{
  PetscFunctionBeginUser;
  s->n = s->carried = 0;
  for (PetscInt i = 0; i < s->names.nbox; i++) {
    if (s->names.group[i][0]) PetscCall(add_carried(s, kind, surface, i));
    else PetscCall(add_images(s, kind, s->given + i));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BoxesDestroy(Boxes *s)
{
  PetscFunctionBeginUser;
  PetscCall(PetscFree(s->box));
  s->n = s->capacity = 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscBool BoxesRefine(const Boxes *s, PetscInt dim, PetscInt level, const PetscReal x[], PetscReal h)
{
  for (PetscInt i = 0; i < s->n; i++) {
    const MeshBox  *b    = s->box + i;
    const PetscInt  less = PetscMax(0, b->levels - 1 - level);
    const PetscReal last = h / (PetscReal)((PetscInt)1 << less); /* side of what is halved last */
    PetscReal       d    = 0;

    if (level >= b->levels) continue;
    for (PetscInt a = 0; a < dim; a++) {
      PetscReal at = 0;

      for (PetscInt e = 0; e < dim; e++) at += b->axis[a][e] * (x[e] - b->origin[e]);
      d += PetscSqr(PetscMax(0, PetscMax(b->lower[a] - at, at - b->upper[a])));
    }
    if (PetscSqrtReal(d) < SLOPE * (h - last) + 0.5 * last) return PETSC_TRUE;
  }
  return PETSC_FALSE;
}
