/* ElasticInertia: see elasticinertia.h. */
#include "compat.h"
#include "elasticinertia.h"
#include "pointcells.h"
#include "base/algebra.h"
#include "base/array.h"

#define BEYOND 0.8 /* of a half-width out of a solid's cells: edges of two meshes along one curve */

/* One solid at its predicted position */
typedef struct {
  const SolidsState *s;
  const SolidGroup  *group;
  const PetscReal   *x; /* [mesh.nnode][dim] */
  PetscInt           first;
  PetscReal          centre[3];
  PointCells         cells;
} Located;

PetscErrorCode ElasticInertiaCreate(const MeshLocal *l, ElasticInertia *in)
{
  PetscFunctionBeginUser;
  *in = (ElasticInertia){.n = 0};
  PetscCall(ElementCreate(l->dim, &in->tables));
  PetscCall(PetscCalloc1(l->nnode_all * l->dim, &in->nodal));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ElasticInertiaDestroy(ElasticInertia *in)
{
  PetscFunctionBeginUser;
  PetscCall(ElementDestroy(&in->tables));
  PetscCall(PetscFree(in->cell));
  PetscCall(PetscFree(in->solid));
  PetscCall(PetscFree(in->matrix));
  PetscCall(PetscFree(in->force));
  PetscCall(PetscFree(in->nodal));
  *in = (ElasticInertia){.n = 0};
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The node that is next to a point in no cell of the solid, as a cell and a position in it */
static void find_node(const Located *s, const PetscReal x[], PetscInt *cell, PetscReal xi[])
{
  const SolidMesh *m    = &s->group->mesh;
  PetscReal        best = PETSC_MAX_REAL;

  for (PetscInt i = 0; i < m->ncell * m->nb; i++) {
    PetscReal far = 0;
    PetscInt  j   = i % m->nb;

    for (PetscInt a = 0; a < m->dim; a++) far += PetscSqr(s->x[m->dim * m->cell_node[i] + a] - x[a]);
    if (far >= best) continue;
    best  = far;
    *cell = i / m->nb;
    for (PetscInt a = 0; a < m->dim; a++, j /= 3) xi[a] = (PetscReal)(j % 3 - 1);
  }
}

/* Density of the solid and what the scheme has of its velocities, d0 u_s + d1 u_s_old, at x */
static PetscErrorCode evaluate(const Located *s, const FlowStep *step, const PetscReal x[], PetscReal *density,
                               PetscReal d[])
{
  const SolidMesh *m = &s->group->mesh;
  PetscReal        xi[3], far, phi[ELEMENT_MAX_NB], dphi[3 * ELEMENT_MAX_NB], now[SOLID_MAX_N], at[SOLID_MAX_N];
  PetscInt         cell;

  PetscFunctionBeginUser;
  PetscCall(PointCellsFind(s->cells, x, &cell, xi, &far));
  if (cell < 0) find_node(s, x, &cell, xi);
  ElementBasis(m->dim, xi, phi, dphi);
  for (PetscInt a = 0; a < m->dim; a++) d[a] = 0;
  for (PetscInt j = 0; j < m->nb; j++)
    for (PetscInt a = 0; a < m->dim; a++) {
      const PetscInt i = m->dim * (s->first + m->cell_node[cell * m->nb + j]) + a;

      d[a] += phi[j] * (step->d0 * s->s->u[i] + step->d1 * s->s->u_old[i]);
    }
  *density = s->group->density;
  if (s->group->compressible) {
    PetscReal y[3], J[9], J0[9];

    SolidGather(m, cell, s->x, now);
    SolidGather(m, cell, m->X, at);
    ElementMap(m->dim, now, xi, y, J);
    ElementMap(m->dim, at, xi, y, J0);
    *density *= DenseDeterminant(m->dim, J0) / DenseDeterminant(m->dim, J);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* M [nb][nb], f [nb][dim]: of a cell with nodes xc [nb][dim] */
static PetscErrorCode integrate(const ElementTables *t, const Located *s, const FlowStep *step, const MeshLocal *l,
                                const PetscReal gravity[], const PetscReal xc[], PetscReal M[], PetscReal f[])
{
  const PetscInt dim = t->dim, nb = t->nb;
  ElementMetric  metric;

  PetscFunctionBeginUser;
  ElementSetMetric(t, xc, &metric);
  PetscCall(PetscArrayzero(M, nb * nb));
  PetscCall(PetscArrayzero(f, nb * dim));
  for (PetscInt q = 0; q < t->nq; q++) {
    const PetscReal *phi  = t->phi + q * t->nbp;
    PetscReal        x[3] = {0, 0, 0}, d[3], density = 0;

    for (PetscInt j = 0; j < nb; j++)
      for (PetscInt a = 0; a < dim; a++) x[a] += phi[j] * xc[dim * j + a];
    for (PetscInt a = 0; a < dim; a++) x[a] = s->centre[a] + MeshNearest(l, a, x[a] - s->centre[a]);
    PetscCall(evaluate(s, step, x, &density, d));
    density *= metric.weight[q];
    for (PetscInt i = 0; i < nb; i++) {
      for (PetscInt j = 0; j < nb; j++) M[i * nb + j] += step->ct * density * phi[i] * phi[j];
      for (PetscInt a = 0; a < dim; a++) f[i * dim + a] += density * phi[i] * (d[a] + gravity[a]);
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode add_cell(ElasticInertia *in, Mesh mesh, const MeshLocal *l, const Located *s, PetscInt k,
                               PetscInt c, const FlowStep *step, const PetscReal gravity[], PetscReal lumped[])
{
  const PetscInt nb = l->nb, dim = l->dim;
  PetscReal      xc[MESH_MAX_NB * 3], *M, *f;

  PetscFunctionBeginUser;
  PetscCall(ArrayReserve(in->n + 1, &in->capacity, &in->cell, sizeof(*in->cell), &in->solid, sizeof(*in->solid),
                         &in->matrix, (size_t)(nb * nb) * sizeof(*in->matrix), &in->force,
                         (size_t)(nb * dim) * sizeof(*in->force), NULL));
  M                = in->matrix + in->n * nb * nb;
  f                = in->force + in->n * nb * dim;
  in->cell[in->n]  = c;
  in->solid[in->n] = k;
  in->n++;
  PetscCall(MeshCellCoordinates(mesh, c, xc));
  PetscCall(integrate(&in->tables, s, step, l, gravity, xc, M, f));
  MeshCellMatrix(l, c, 1, nb, M);
  MeshCellScatter(l, c, dim, f);
  if (c >= l->ncell) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt i = 0; i < nb; i++) {
    const PetscInt node = l->cell_node[c * nb + i];

    for (PetscInt a = 0; a < dim; a++) in->nodal[dim * node + a] += f[dim * i + a];
    for (PetscInt j = 0; j < nb; j++) lumped[node] += M[i * nb + j];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ElasticInertiaAssemble(ElasticInertia *in, Flow flow, const FlowStep *step, const SolidsState *s,
                                      const PetscReal x[], const PetscInt cell_solid[], PetscReal lumped[])
{
  const FlowParameters *par;
  const MeshLocal      *l;
  Mesh                  mesh;
  Located              *at;

  PetscFunctionBeginUser;
  PetscCall(FlowGetParameters(flow, &par));
  PetscCall(FlowGetMesh(flow, &mesh));
  PetscCall(MeshGetLocal(mesh, &l));
  in->n = 0;
  PetscCall(PetscArrayzero(in->nodal, l->nnode_all * l->dim));
  PetscCall(PetscCalloc1(s->n, &at));
  for (PetscInt c = 0; c < l->ncell_all; c++) {
    const PetscInt k = cell_solid[c];

    if (k < 0) continue;
    if (!at[k].cells) {
      at[k] = (Located){.s     = s,
                        .group = s->group + s->group_of[k],
                        .x     = x + l->dim * s->first[k],
                        .first = s->first[k]};
      (void)SolidFindVolume(&at[k].group->mesh, at[k].x, at[k].centre);
      PetscCall(PointCellsCreateOf(l->dim, at[k].group->mesh.ncell, at[k].group->mesh.cell_node, at[k].x, BEYOND,
                                   &at[k].cells));
    }
    PetscCall(add_cell(in, mesh, l, &at[k], k, c, step, par->gravity, lumped));
  }
  for (PetscInt k = 0; k < s->n; k++)
    if (at[k].cells) PetscCall(PointCellsDestroy(&at[k].cells));
  PetscCall(PetscFree(at));
  PetscCall(FlowAddCellTerms(flow, in, in->n, in->cell, in->matrix));
  PetscCall(FlowAddForce(flow, in, in->nodal));
  PetscFunctionReturn(PETSC_SUCCESS);
}

void ElasticInertiaAddForce(const ElasticInertia *in, const MeshLocal *l, const PetscReal u[], PetscReal push[])
{
  const PetscInt nb = l->nb, dim = l->dim;

  for (PetscInt e = 0; e < in->n; e++) {
    const PetscInt  *node = l->cell_node + in->cell[e] * nb;
    const PetscReal *M = in->matrix + e * nb * nb, *f = in->force + e * nb * dim;

    for (PetscInt i = 0; i < nb && in->cell[e] < l->ncell; i++)
      for (PetscInt a = 0; a < dim; a++) {
        PetscReal r = f[dim * i + a];

        for (PetscInt j = 0; j < nb; j++) r -= M[i * nb + j] * u[dim * node[j] + a];
        push[in->solid[e] * dim + a] += r;
      }
  }
}

PetscErrorCode ElasticIntegrateCell(const ElementTables *t, Mesh mesh, const MeshLocal *l, PetscInt cell,
                                    PetscReal whole[])
{
  PetscReal     xc[MESH_MAX_NB * 3];
  ElementMetric metric;

  PetscFunctionBeginUser;
  PetscCall(MeshCellCoordinates(mesh, cell, xc));
  ElementSetMetric(t, xc, &metric);
  for (PetscInt j = 0; j < l->nb; j++) whole[j] = 0;
  for (PetscInt q = 0; q < t->nq; q++)
    for (PetscInt j = 0; j < l->nb; j++) whole[j] += metric.weight[q] * t->phi[q * t->nbp + j];
  MeshCellScatter(l, cell, 1, whole);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* flux [dim] += int u over a cell */
static PetscErrorCode add_flux(const ElementTables *t, Mesh mesh, const MeshLocal *l, PetscInt cell,
                               const PetscReal u[], PetscReal flux[])
{
  const PetscInt nb = l->nb, dim = l->dim;
  PetscReal      whole[MESH_MAX_NB];

  PetscFunctionBeginUser;
  PetscCall(ElasticIntegrateCell(t, mesh, l, cell, whole));
  for (PetscInt j = 0; j < nb * dim; j++)
    flux[j % dim] += whole[j / dim] * u[dim * l->cell_node[cell * nb + j / dim] + j % dim];
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ElasticInertiaPower(const ElasticInertia *in, Mesh mesh, const MeshLocal *l, const PetscReal u[],
                                   PetscReal *terms, PetscReal *force, PetscReal flux[])
{
  const PetscInt nb = l->nb, dim = l->dim;

  PetscFunctionBeginUser;
  *terms = *force = 0;
  for (PetscInt a = 0; a < dim; a++) flux[a] = 0;
  for (PetscInt e = 0; e < in->n; e++) {
    const PetscInt  *node = l->cell_node + in->cell[e] * nb;
    const PetscReal *M    = in->matrix + e * nb * nb;

    if (in->cell[e] >= l->ncell) continue;
    PetscCall(add_flux(&in->tables, mesh, l, in->cell[e], u, flux));
    for (PetscInt i = 0; i < nb * nb; i++)
      for (PetscInt a = 0; a < dim; a++) *terms += u[node[i / nb] * dim + a] * M[i] * u[node[i % nb] * dim + a];
  }
  for (PetscInt i = 0; i < l->nnode_all * dim; i++) *force += in->nodal[i] * u[i];
  PetscFunctionReturn(PETSC_SUCCESS);
}
