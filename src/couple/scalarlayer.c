/* ScalarLayer: see scalarlayer.h. */
#include "compat.h"
#include "impl.h"
#include "scalarbodies.h"
#include "scalarlayer.h"
#include "scalar/layer.h"
#include "base/algebra.h"

#define CHUNK 256

/* Velocity of the fluid at x - centre = r against a body with velocities u, w, less that which its spin makes of a
   fluid at rest, w x r (R/|r|)^dim */
static PetscReal find_speed(PetscInt dim, const PetscReal fluid[], const PetscReal u[3], const PetscReal w[3],
                            const PetscReal r[3], PetscReal R)
{
  const PetscReal less = PetscPowRealInt(R / PetscSqrtReal(dot3(r, r)), (int)dim);
  PetscReal       spin[3], sum = 0;

  cross(w, r, spin);
  for (PetscInt a = 0; a < dim; a++) sum += PetscSqr(fluid[a] - u[a] - less * spin[a]);
  return PetscSqrtReal(sum);
}

/* Nodes list [n] near the image of body k at X: found[0] <- fastest fluid within a radius of its surface, found[1] <-
   size of the largest cell at it */
static PetscErrorCode see_nodes(Couple c, PetscInt k, const PetscReal X[3], PetscInt n, const PetscInt node[],
                                const PetscReal u[], PetscReal found[2])
{
  const MeshLocal *l = c->loc;
  const PetscReal *size, R = BodiesGetRadius(c->s, k);
  PetscReal        x[CHUNK * 3], d[CHUNK];

  PetscFunctionBeginUser;
  PetscCall(FlowGetCellSize(c->flow, &size));
  for (PetscInt e = 0; e < n * l->dim; e++) x[e] = l->x[node[e / l->dim] * l->dim + e % l->dim];
  PetscCall(BodiesDistance(c->bodies, k, X, c->s->q[k], n, x, d));
  for (PetscInt e = 0; e < n; e++) {
    const PetscInt i = node[e], cell = l->centre_cell[i];
    PetscReal      r[3] = {0, 0, 0};

    if (i >= l->nnode) continue;
    if (cell >= 0 && PetscAbsReal(d[e]) < size[cell]) found[1] = PetscMax(found[1], size[cell]);
    if (d[e] <= 0 || d[e] > R) continue;
    for (PetscInt a = 0; a < l->dim; a++) r[a] = x[e * l->dim + a] - X[a];
    found[0] = PetscMax(found[0], find_speed(l->dim, u + i * l->dim, c->s->u[k], c->s->w[k], r, R));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarLayerMeasure(Couple c, const ScalarParameters *par, const PetscBool open[], ScalarLayer layer[])
{
  const PetscReal nu = c->par->viscosity / c->par->density, D = par->conductivity / par->capacity;
  PetscReal      *u, (*found)[2], cells;

  PetscFunctionBeginUser;
  PetscCall(FlowGetFields(c->flow, &u, NULL, NULL));
  PetscCall(PetscCalloc1(c->s->n, &found));
  for (PetscInt k = 0; k < c->s->n; k++) {
    const PetscReal R = BodiesGetRadius(c->s, k);

    if (c->s->removed[k] || !open[c->s->body_group[k]]) continue;
    for (DomainImages image = {0}; MeshNextImage(c->loc, c->s->x[k], 2 * R, &image);) {
      const PetscInt *list;
      PetscInt        n;

      PetscCall(MeshNodesInBox(c->mesh, image.at, 2 * R, &n, &list));
      for (PetscInt e = 0; e < n; e += CHUNK)
        PetscCall(see_nodes(c, k, image.at, PetscMin(CHUNK, n - e), list + e, u, found[k]));
    }
  }
  PetscCall(BodiesMaxLocal(c->bodies, 2, (PetscReal *)found));
  for (PetscInt g = 0; g < c->s->ngroups; g++) layer[g] = (ScalarLayer){PETSC_MAX_REAL, 0, 0};
  for (PetscInt k = 0; k < c->s->n; k++) {
    const PetscReal d = 2 * BodiesGetRadius(c->s, k), speed = found[k][0];
    PetscReal       through[3] = {0, 0, 0}; /* the mesh */
    ScalarLayer    *at         = layer + c->s->body_group[k];

    if (found[k][1] == 0 || D <= 0 || nu <= 0) continue;
    for (PetscInt a = 0; a < c->loc->dim; a++) through[a] = c->s->u[k][a] - c->step->frame[a];
    at->way = PetscMax(at->way, dot3(through, through) * c->step->dt / D);
    cells   = ScalarLayerThickness(d, speed * d / nu, speed * d / D) / found[k][1];
    if (cells >= at->cells) continue;
    at->cells  = cells;
    at->peclet = speed * d / D;
  }
  for (PetscInt g = 0; g < c->s->ngroups; g++) {
    PetscReal largest[2] = {layer[g].peclet, layer[g].way};

    cells = layer[g].cells;
    PetscCall(BodiesMin(c->bodies, 1, &layer[g].cells));
    if (cells > layer[g].cells) largest[0] = 0;
    PetscCall(BodiesMax(c->bodies, 2, largest));
    layer[g].peclet = largest[0];
    layer[g].way    = largest[1];
  }
  PetscCall(PetscFree(found));
  PetscFunctionReturn(PETSC_SUCCESS);
}
