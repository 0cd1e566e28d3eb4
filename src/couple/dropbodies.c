/* CoupleDrops, bodies: rigid particles beside drops. They are held by the penalty, in cells of the fluid around: cells
   that a body cuts or that are next to it are no drop's, so that a film of about a cell stays between (not wetted),
   which drains no further than the mesh knows. The step does so before rigid.c predicts bodies, which is therefore done
   here too. */
#include "compat.h"
#include "drops.h"
#include "impl.h"
#include "bodies/local.h"

#define FILM 1.0 /* cells from a body to the middle of the first cell that a drop may have */
#define SOME 256 /* middles at a time */

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
