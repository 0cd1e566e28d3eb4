/* Couple, phoretic slip: -mobility (I - n n) grad T on surfaces, T a scalar (couple/scalars.h) at the beginning of the
   step (Anderson, Annu. Rev. Fluid Mech. 21, 61 (1989)). Only values on the surface are needed: the gradient along it
   at a node is the mean over the faces of cells of the fluid around it (corners of such cells may be flat, and their
   own gradient is none there). */
#include "compat.h"
#include "impl.h"
#include "bodies/slip.h"
#include "couple/scalars.h"
#include "base/algebra.h"
#include "fem/side.h"

/* Derivatives at -1, 0, 1 of the parabola through values there */
static const PetscReal SLOPE[3][3] = {{-1.5, 2, -0.5}, {-0.5, 0, 0.5}, {0.5, -2, 1.5}};

/* Gradient along the face with these slots of t [nb] at its point q: xc [nb][dim]; tangents and what t changes along
   them by the inverse of their metric */
static void add_face_gradient(PetscInt dim, const PetscInt slot[], PetscInt q, const PetscReal xc[],
                              const PetscReal t[], PetscReal sum[])
{
  PetscReal e[2][3] = {{0}}, change[2] = {0, 0}, m[3], det;

  for (PetscInt d = 0; d < dim - 1; d++)
    for (PetscInt i = 0; i < 3; i++) {
      const PetscInt  j = slot[d == 0 ? q / 3 * 3 + i : i * 3 + q % 3];
      const PetscReal w = SLOPE[d == 0 ? q % 3 : q / 3][i];

      change[d] += w * t[j];
      for (PetscInt a = 0; a < dim; a++) e[d][a] += w * xc[j * dim + a];
    }
  m[0] = dot3(e[0], e[0]);
  m[1] = dot3(e[0], e[1]);
  m[2] = dim == 3 ? dot3(e[1], e[1]) : 1;
  det  = m[0] * m[2] - m[1] * m[1];
  if (det <= 0) return;
  for (PetscInt a = 0; a < dim; a++)
    sum[a] += ((m[2] * change[0] - m[1] * change[1]) * e[0][a] + (m[0] * change[1] - m[1] * change[0]) * e[1][a]) / det;
  sum[dim] += 1;
}

/* Adds the gradient of T along the surface at the nodes of cell e that lie on it: sum [nnode_all][dim + 1], the last
   counts */
static PetscErrorCode add_gradients(Couple c, PetscInt e, const PetscInt body[], const PetscReal T[], PetscReal sum[])
{
  const MeshLocal *l   = c->loc;
  const PetscInt   dim = l->dim, nb = l->nb, *node = l->cell_node + e * nb, npoint = nb / 3;
  PetscReal        xc[MESH_MAX_NB * 3], t[MESH_MAX_NB];

  PetscFunctionBeginUser;
  PetscCall(MeshCellCoordinates(c->mesh, e, xc));
  MeshCellValues(l, e, 1, T, t);
  for (PetscInt face = 0; face < 2 * dim; face++) {
    PetscBool on = PETSC_TRUE;
    PetscInt  slot[SIDE_MAX];

    SideList(dim, face, slot);
    for (PetscInt q = 0; q < npoint; q++) {
      const PetscInt i = node[slot[q]];

      on = (PetscBool)(on && body[i] >= 0 && body[i] == body[node[slot[0]]] && c->method.on_surface[i]);
    }
    for (PetscInt q = 0; q < npoint && on; q++) add_face_gradient(dim, slot, q, xc, t, sum + node[slot[q]] * (dim + 1));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Is cell e inside of one body? All of its nodes are then that body's. */
static PetscBool is_covered(const MeshLocal *l, PetscInt e, const PetscInt body[])
{
  const PetscInt *node = l->cell_node + e * l->nb;

  for (PetscInt j = 0; j < l->nb; j++)
    if (body[node[j]] < 0 || body[node[j]] != body[node[0]]) return PETSC_FALSE;
  return PETSC_TRUE;
}

PetscErrorCode CoupleFindScalar(Couple c, const char name[], PetscInt *i)
{
  const CoupleScalar *scalar;
  PetscInt            n;

  PetscFunctionBeginUser;
  PetscCall(CoupleGetScalars(c, &n, &scalar));
  for (*i = 0; *i < n && strcmp(scalar[*i].par->name, name); ++*i) {}
  if (*i == n) *i = -1;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleAddPhoreticSlip(Couple c, PetscInt group, const PetscReal normal[], PetscReal velocity[])
{
  const MeshLocal    *l   = c->loc;
  const PetscInt      dim = l->dim, *body, *cell, *node;
  const CoupleScalar *scalar;
  PetscInt            n, i;
  PetscReal          *T, *sum;

  PetscFunctionBeginUser;
  if (!c->method.on_surface) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(CoupleFindScalar(c, BodySlipScalar(c->s->group[group].slip), &i));
  PetscCall(CoupleGetScalars(c, &n, &scalar));
  PetscCall(PetscCalloc2(l->nnode_all, &T, l->nnode_all * (dim + 1), &sum));
  PetscCall(CoupleGetScalarField(c, i, T));
  PetscCall(IndicatorGetNodes(c->indicator, &body, NULL, NULL));
  PetscCall(IndicatorGetCells(c->indicator, &n, &cell));
  for (PetscInt e = 0; e < n; e++)
    if (!is_covered(l, cell[e], body)) PetscCall(add_gradients(c, cell[e], body, T, sum));
  PetscCall(MeshSumNodes(c->mesh, dim + 1, sum));
  PetscCall(MeshSyncNodes(c->mesh, dim + 1, sum));
  PetscCall(IndicatorGetNodes(c->indicator, NULL, &n, &node));
  for (PetscInt e = 0; e < n; e++) {
    const PetscInt  at = node[e], k = body[at];
    const PetscReal count = sum[at * (dim + 1) + dim], *normal_at = normal + at * dim;
    PetscReal       mobility, slope[3], x[3], across = 0;

    if (k < 0 || c->s->body_group[k] != group || !c->method.on_surface[at] || count <= 0) continue;
    for (PetscInt a = 0; a < dim; a++) {
      slope[a] = sum[at * (dim + 1) + a] / count + scalar[i].par->gradient[a];
      x[a]     = c->rigid.X[k][a] + MeshNearest(l, a, l->x[at * dim + a] - c->rigid.X[k][a]);
      across += slope[a] * normal_at[a];
    }
    PetscCall(BodiesGetSlipMobility(c->bodies, k, c->rigid.X[k], c->rigid.q[k], c->step->time, x, &mobility));
    for (PetscInt a = 0; a < dim; a++) velocity[at * dim + a] -= mobility * (slope[a] - across * normal_at[a]);
  }
  PetscCall(PetscFree2(T, sum));
  PetscFunctionReturn(PETSC_SUCCESS);
}
