/* CoupleDrops, bodies: rigid particles beside drops. They are held by the penalty, in cells of the fluid around: cells
   that a body cuts or that are next to it are no drop's, so that a film of about a cell stays between (not wetted),
   which drains no further than the mesh knows. The step does so before rigid.c predicts bodies, which is therefore done
   here too. */
#include "compat.h"
#include "drops.h"
#include "impl.h"
#include "bodies/local.h"

#define FILM   1.0 /* cells from a body to the middle of the first cell that a drop may have */
#define SOME   256 /* middles at a time */
#define DEEP   0.5 /* cells that a body may reach into a drop at the start, as near ones do whose film is a cell */
#define POINTS 100 /* of its surface, in space four times as many */

/* Middles of own cells among the nodes of the list of the image at X of a body turned by q */
static PetscErrorCode close_near(CoupleDrops *f, Couple c, PetscInt k, const PetscReal X[3], const PetscReal q[4],
                                 PetscInt n, const PetscInt list[])
{
  const MeshLocal *l = c->loc;
  PetscInt         m = 0, cell[SOME];
  PetscReal        x[3 * SOME], d[SOME];

  PetscFunctionBeginUser;
  for (PetscInt e = 0; e <= n; e++) {
    if (e < n && list[e] < l->nnode && l->centre_cell[list[e]] >= 0) {
      for (PetscInt a = 0; a < l->dim; a++) x[l->dim * m + a] = l->x_start[l->dim * list[e] + a];
      cell[m++] = l->centre_cell[list[e]];
    }
    if (m < SOME && e < n) continue;
    PetscCall(BodiesDistance(c->bodies, k, X, q, m, x, d));
    for (PetscInt i = 0; i < m; i++)
      if (d[i] < FILM * l->h) f->closed[cell[i]] = PETSC_TRUE;
    m = 0;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* *group: of the drop that own body k overlaps in part, -1: none; drops have the numbers of their groups still */
static PetscErrorCode find_overlap(const CoupleDrops *f, Couple c, PetscInt k, PetscInt *group)
{
  const MeshLocal *l = c->loc;
  PetscReal       *x, d, inner = 0, outer = 0;
  PetscInt         n, deepest = -1, drop;

  PetscFunctionBeginUser;
  *group = -1;
  PetscCall(DropsFindDeepest(f, l, c->s->x[k], &drop, &d));
  if (d > BodiesGetRadius(c->s, k)) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(BodiesSurfacePoints(c->bodies, k, NULL, NULL, POINTS * (l->dim == 2 ? 1 : 4), &n, &x, NULL));
  for (PetscInt i = 0; i < n; i++) {
    PetscCall(DropsFindDeepest(f, l, x + l->dim * i, &drop, &d));
    if (d < inner) deepest = drop;
    inner = PetscMin(inner, d);
    outer = PetscMax(outer, d);
  }
  if (inner < -DEEP * l->h && outer > 0) *group = deepest;
  PetscCall(PetscFree(x));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DropsCheckOverlap(const CoupleDrops *f, Couple c)
{
  PetscInt at = -1; /* group of bodies times that of drops, and its group */

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < c->s->n; k++) {
    PetscInt group;

    if (!c->s->own[k] || c->s->removed[k] || f->angle[c->s->body_group[k]] > 0) continue;
    PetscCall(find_overlap(f, c, k, &group));
    if (group >= 0) at = PetscMax(at, c->s->body_group[k] * f->s->ngroups + group);
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &at, 1, MPIU_INT, MPI_MAX, c->comm));
  if (at < 0) PetscFunctionReturn(PETSC_SUCCESS);
  SETERRQ(c->comm, PETSC_ERR_USER_INPUT,
          "A body of group '%s' overlaps the drop '%s' at the start, which does not wet it: move one of them (-particle_%s_position), or "
          "give -particle_%s_contact_angle",
          c->s->group[at / f->s->ngroups].name, f->s->group[at % f->s->ngroups].name,
          f->s->group[at % f->s->ngroups].name, c->s->group[at / f->s->ngroups].name);
}

PetscErrorCode DropsCloseCells(CoupleDrops *f, Couple c)
{
  PetscFunctionBeginUser;
  if (!f->closed) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscArrayzero(f->closed, c->loc->ncell));
  PetscCall(BodiesSetTime(c->bodies, c->step->time - c->step->dt));
  for (PetscInt k = 0; k < c->s->n; k++) {
    const PetscReal radius = BodiesGetRadius(c->s, k) + FILM * c->loc->h;
    PetscReal       X[3], q[4], angle;

    if (c->s->removed[k] || f->angle[c->s->body_group[k]] > 0 || BodiesGetGroup(c->s, k)->body_fitted) continue;
    PetscCall(BodiesPredict(c->bodies, k, c->step->dt, c->implicit ? c->step->order : 0, X, q, &angle));
    for (DomainImages i = {0}; MeshNextImage(c->loc, X, radius, &i);) {
      const PetscInt *list;
      PetscInt        n;

      PetscCall(MeshNodesInBox(c->mesh, i.at, radius, &n, &list));
      PetscCall(close_near(f, c, k, i.at, q, n, list));
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}
