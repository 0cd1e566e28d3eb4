/* CoupleDrops, feet: old velocities at the feet of the trajectories that end in the nodes of the new mesh, and how fast
   the nodes move. A node at x comes from y^n = x - chi d(y^n), d the displacement of the fluid in the step, chi 1 near
   the interface and 0 away from it, and before that from y^(n-1), which the step before knew at y^n. */
#include "compat.h"
#include "drops.h"
#include "impl.h"

#define NEAR 3 /* cells: chi is 1 */
#define FAR  6 /* and 0 from here on */

typedef struct {
  PetscInt   n; /* own nodes that are carried */
  PetscInt  *node;
  PetscReal *x, *chi; /* [n][dim]; [n] */
  PetscReal *value;   /* [n][4][dim]: x - y, then u, u_old and what was x - y in the step before, at y */
} Feet;

/* Where the nodes will be, all */
static PetscErrorCode new_places(const CoupleDrops *f, const MeshLocal *l, PetscReal x[])
{
  const PetscInt dim = l->dim;

  PetscFunctionBeginUser;
  PetscCall(PetscArraycpy(x, l->x, dim * l->nnode_all));
  for (PetscInt e = 0; e < f->result.nnode; e++)
    for (PetscInt a = 0; a < dim; a++) x[dim * f->result.node[e] + a] = f->result.x[dim * e + a];
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* chi at a place, by the nearest image of the interface (before the first step nothing has moved) */
static PetscReal weight_at(const CoupleDrops *f, const MeshLocal *l, const PetscReal x[])
{
  const PetscReal      reach = FAR * l->h, place[3] = {x[0], x[1], l->dim == 3 ? x[2] : 0};
  PetscReal            best = reach;
  const AlignSurfaces *s    = PhaseSurfacesGet(f->surfaces);

  if (!PhaseInterfaceSize(&f->interface)) return 0;
  for (DomainImages i = {0}; MeshNextImage(l, place, PETSC_MAX_REAL / 4, &i);) {
    PetscReal  square = 0;
    PhasePoint p;

    for (PetscInt a = 0; a < l->dim; a++) square += PetscSqr(i.at[a] - s->centre[0][a]);
    if (PetscSqrtReal(square) > s->radius[0] + reach) continue;
    if (l->dim == 3) {
      best = PhaseSheetNear(&f->interface.sheet, i.at, best); /* about */
      continue;
    }
    PhaseInterfaceClosest(&f->interface, i.at, best, &p);
    if (p.edge >= 0) best = PetscMin(best, PetscAbsReal(p.d));
  }
  return PetscMax(0, PetscMin(1, (FAR - best / l->h) / (FAR - NEAR)));
}

/* Does node i move, or did it in the step before? */
static PetscBool is_moved(const CoupleDrops *f, const MeshLocal *l, const PetscReal x[], PetscInt i)
{
  for (PetscInt a = l->dim * i; a < l->dim * (i + 1); a++)
    if (l->x[a] != x[a] || f->shift[a] != 0) return PETSC_TRUE;
  return PETSC_FALSE;
}

static PetscErrorCode list_nodes(const CoupleDrops *f, const MeshLocal *l, const PetscReal x[], Feet *t)
{
  const PetscInt dim = l->dim;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc4(l->nnode, &t->node, dim * l->nnode, &t->x, l->nnode, &t->chi, 4 * dim * l->nnode, &t->value));
  for (PetscInt i = 0; i < l->nnode; i++) {
    const PetscReal chi = weight_at(f, l, x + dim * i);

    if (chi == 0 && !is_moved(f, l, x, i)) continue;
    t->node[t->n] = i;
    t->chi[t->n]  = chi;
    PetscCall(PetscArraycpy(t->x + dim * t->n, x + dim * i, dim));
    t->n++;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* f->velocity and f->shift of this step; value [n][2][dim] */
static PetscErrorCode find_velocity(CoupleDrops *f, Couple c, const Feet *t, PetscReal value[])
{
  const FlowStep *s   = c->step;
  const PetscInt  dim = c->loc->dim, n = dim * c->loc->nnode_all;

  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(f->velocity, n));
  PetscCall(PetscArrayzero(f->shift, n));
  for (PetscInt e = 0; e < t->n; e++)
    for (PetscInt a = 0; a < dim; a++) {
      const PetscReal *v   = t->value + 4 * dim * e + a;
      const PetscReal  now = v[0], before = now + v[3 * dim];

      f->shift[dim * t->node[e] + a]    = now;
      f->velocity[dim * t->node[e] + a] = s->d0 * now + s->d1 * before;
      for (PetscInt k = 0; k < 2; k++) value[2 * dim * e + dim * k + a] = v[dim * (1 + k)];
    }
  PetscCall(MeshSyncNodes(c->mesh, dim, f->velocity));
  PetscCall(MeshSyncNodes(c->mesh, dim, f->shift));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DropsCarry(CoupleDrops *f, Couple c, PetscInt *n, PetscInt *node[], PetscReal *value[])
{
  const MeshLocal *l = c->loc;
  Feet             t = {.n = 0};
  PetscReal       *x, *u, *u_old;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(l->dim * l->nnode_all, &x));
  PetscCall(new_places(f, l, x));
  PetscCall(list_nodes(f, l, x, &t));
  PetscCall(FlowGetFields(c->flow, &u, &u_old, NULL));
  {
    const PetscReal *field[3] = {u, u_old, f->shift};

    PetscCall(RemapEvaluateFeet(f->remap, t.n, t.node, t.x, f->way, t.chi, 3, field, t.value));
  }
  *n = t.n;
  PetscCall(PetscMalloc1(t.n, node));
  PetscCall(PetscMalloc1(2 * l->dim * t.n, value));
  PetscCall(PetscArraycpy(*node, t.node, t.n));
  PetscCall(find_velocity(f, c, &t, *value));
  PetscCall(PetscFree4(t.node, t.x, t.chi, t.value));
  PetscCall(PetscFree(x));
  PetscFunctionReturn(PETSC_SUCCESS);
}
