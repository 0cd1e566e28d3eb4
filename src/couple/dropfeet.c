/* CoupleDrops, feet: old velocities at the feet of the trajectories that end in the nodes of the new mesh, and how fast
   the nodes move. A node at x comes from y^n = x - chi d(y^n), d the displacement of the fluid in the step, chi 1 near
   the interface and 0 away from it, and before that from y^(n-1), which the step before knew at y^n. */
#include "compat.h"
#include "drops.h"
#include "impl.h"

#define NEAR   3 /* cells: chi is 1 */
#define FAR    6 /* and 0 from here on */
#define ROUNDS 5

typedef struct {
  PetscInt   n, moving; /* own nodes that are carried, first those with chi > 0 */
  PetscInt  *node, *side;
  PetscReal *x, *y, *chi; /* [n][2] */
  PetscReal *value;       /* [n][3][2] */
} Feet;

/* Where the nodes will be, all */
static PetscErrorCode new_places(const CoupleDrops *f, const MeshLocal *l, PetscReal x[])
{
  PetscFunctionBeginUser;
  PetscCall(PetscArraycpy(x, l->x, 2 * l->nnode_all));
  for (PetscInt e = 0; e < f->result.nnode; e++)
    for (PetscInt a = 0; a < 2; a++) x[2 * f->result.node[e] + a] = f->result.x[2 * e + a];
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* chi at a place, by the nearest image of the interface */
static PetscReal weight_at(const CoupleDrops *f, const MeshLocal *l, const PetscReal x[2])
{
  const PetscReal      reach = FAR * l->h;
  PetscReal            best  = reach;
  const AlignSurfaces *s     = PhaseSurfacesGet(f->surfaces);

  /* images of the place that may be near the curve */
  for (PetscInt i = -1; i <= 1; i++)
    for (PetscInt j = -1; j <= 1; j++) {
      const PetscReal at[2] = {x[0] + (PetscReal)i * l->period[0], x[1] + (PetscReal)j * l->period[1]};
      PhasePoint      p;

      if ((i && l->period[0] == 0) || (j && l->period[1] == 0)) continue;
      if (PetscHypotReal(at[0] - s->centre[0][0], at[1] - s->centre[0][1]) > s->radius[0] + reach) continue;
      PhaseCurveClosest(&f->curve, at, best, &p);
      if (p.edge >= 0) best = PetscMin(best, PetscAbsReal(p.d));
    }
  return PetscMax(0, PetscMin(1, (FAR - best / l->h) / (FAR - NEAR)));
}

static PetscErrorCode list_nodes(const CoupleDrops *f, const MeshLocal *l, const PetscReal x[], Feet *t)
{
  PetscReal *chi;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(l->nnode, &chi));
  PetscCall(PetscMalloc6(l->nnode, &t->node, l->nnode, &t->side, 2 * l->nnode, &t->x, 2 * l->nnode, &t->y, l->nnode,
                         &t->chi, 6 * l->nnode, &t->value));
  for (PetscInt i = 0; i < l->nnode; i++) chi[i] = weight_at(f, l, x + 2 * i);
  for (PetscInt moving = 1; moving >= 0; moving--) {
    for (PetscInt i = 0; i < l->nnode; i++) {
      const PetscReal *at = l->x + 2 * i, *to = x + 2 * i, *e = f->shift + 2 * i;

      if ((chi[i] > 0) != moving || (!moving && at[0] == to[0] && at[1] == to[1] && e[0] == 0 && e[1] == 0)) continue;
      t->node[t->n] = i;
      t->side[t->n] = 0;
      t->chi[t->n]  = chi[i];
      for (PetscInt a = 0; a < 2; a++) t->x[2 * t->n + a] = t->y[2 * t->n + a] = to[a];
      t->n++;
    }
    if (moving) t->moving = t->n;
  }
  PetscCall(PetscFree(chi));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode find_feet(const CoupleDrops *f, Couple c, RemapCells cells, Feet *t)
{
  const MeshLocal *l     = c->loc;
  const PetscReal *field = f->way;
  RemapCount       count;

  PetscFunctionBeginUser;
  for (PetscInt round = 0; round < ROUNDS; round++) {
    PetscCall(RemapEvaluate(f->remap, t->moving, t->node, t->y, t->side, cells, 1, &field, t->value, &count));
    for (PetscInt i = 0; i < 2 * t->moving; i++) {
      const PetscInt a = i % 2;

      t->y[i] = t->x[i] - t->chi[i / 2] * t->value[i];
      if (l->period[a] == 0) t->y[i] = PetscMax(l->lower[a], PetscMin(l->upper[a], t->y[i]));
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* f->velocity and f->shift of this step; value [n][2][2] */
static PetscErrorCode find_velocity(CoupleDrops *f, Couple c, const Feet *t, PetscReal value[])
{
  const FlowStep *s = c->step;
  const PetscInt  n = 2 * c->loc->nnode_all;

  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(f->velocity, n));
  PetscCall(PetscArrayzero(f->shift, n));
  for (PetscInt e = 0; e < t->n; e++)
    for (PetscInt a = 0; a < 2; a++) {
      const PetscReal now = t->x[2 * e + a] - t->y[2 * e + a], before = now + t->value[6 * e + 4 + a];

      f->shift[2 * t->node[e] + a]    = now;
      f->velocity[2 * t->node[e] + a] = s->d0 * now + s->d1 * before;
      for (PetscInt k = 0; k < 2; k++) value[4 * e + 2 * k + a] = t->value[6 * e + 2 * k + a];
    }
  PetscCall(MeshSyncNodes(c->mesh, 2, f->velocity));
  PetscCall(MeshSyncNodes(c->mesh, 2, f->shift));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DropsCarry(CoupleDrops *f, Couple c, PetscInt *n, PetscInt *node[], PetscReal *value[])
{
  const MeshLocal *l = c->loc;
  Feet             t = {.n = 0};
  RemapCells       cells;
  PetscReal       *x, *u, *u_old;
  PetscInt        *none;
  RemapCount       count;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc2(2 * l->nnode_all, &x, 2 * l->ncell_all, &none));
  for (PetscInt e = 0; e < 2 * l->ncell_all; e++) none[e] = e < l->ncell_all ? -1 : 0;
  cells = (RemapCells){none, none + l->ncell_all};
  PetscCall(new_places(f, l, x));
  PetscCall(list_nodes(f, l, x, &t));
  PetscCall(find_feet(f, c, cells, &t));
  PetscCall(FlowGetFields(c->flow, &u, &u_old, NULL));
  {
    const PetscReal *field[3] = {u, u_old, f->shift};

    PetscCall(RemapEvaluate(f->remap, t.n, t.node, t.y, t.side, cells, 3, field, t.value, &count));
  }
  *n = t.n;
  PetscCall(PetscMalloc1(t.n, node));
  PetscCall(PetscMalloc1(4 * t.n, value));
  PetscCall(PetscArraycpy(*node, t.node, t.n));
  PetscCall(find_velocity(f, c, &t, *value));
  PetscCall(PetscFree6(t.node, t.side, t.x, t.y, t.chi, t.value));
  PetscCall(PetscFree2(x, none));
  PetscFunctionReturn(PETSC_SUCCESS);
}
