/* Deform: see deform.h. Numbers of a cell are computed on own and ghost cells alike, so that own vertices see all their cells. */
#include "compat.h"
#include "deform.h"
#include "cells.h"
#include "dense.h"
#include "opt.h"
#include <petscksp.h>

#define MAX_NV  8    /* vertices of a cell */
#define MAX_NQ  27   /* Gauss points */
#define SAFE    0.1  /* smallest Jacobian over the mean of its cell */
#define CORRECT 12   /* further steps at most, until */
#define GOOD    0.02 /* sizes are so close to the wanted ones */
#define REGULARISE \
  1e-2 /* of the mass matrix, over the square of the domain: makes the Neumann problem definite; what it does to the velocity the next steps correct */

typedef struct {
  Mesh             mesh;
  Bodies           bodies;
  BodyState       *s;
  const MeshLocal *l;
  Cells            near; /* bodies with their widths around them */
  PetscReal        size, width;
  PetscInt         steps, dim, nv, nq, nvertex; /* vertices of a cell, Gauss points, own vertices */
  PetscInt         corner[MAX_NV];              /* lattice place of vertex j of a cell */
  PetscReal        phi[MAX_NQ][MAX_NV], dphi[MAX_NQ][MAX_NV][3], weight[MAX_NQ];
  PetscInt        *number;  /* [nnode_all] global number of a vertex, -1: other nodes */
  PetscInt        *held;    /* [nnode_all] bit mask of components that do not move */
  PetscReal       *carried; /* [ncell_all] size of the cell at the start */
  PetscReal       *rest;    /* [nnode_all] integral of the vertex functions over 1/m, then the right-hand side */
  PetscReal       *load;    /* [nnode_all] of rho */
  PetscReal       *w, *v;   /* [nnode_all] potential, [nnode_all][dim] velocity */
  PetscReal       *trial;   /* [nnode_all][dim] places */
  PetscReal        scale;   /* k */
  Mat              K;
  KSP              ksp;
  Vec              x, b;
} Deform;

/* ---- elements ---- */

static void tabulate(Deform *d)
{
  static const PetscReal point[3] = {-0.77459666924148340, 0, 0.77459666924148340}, weight[3] = {5. / 9, 8. / 9, 5. / 9};

  d->nv = 1 << d->dim;
  d->nq = d->dim == 2 ? 9 : 27;
  for (PetscInt j = 0; j < d->nv; j++) d->corner[j] = 2 * (j & 1) + 6 * (j >> 1 & 1) + 18 * (j >> 2);
  for (PetscInt q = 0; q < d->nq; q++) {
    const PetscInt at[3] = {q % 3, q / 3 % 3, q / 9};

    d->weight[q] = 1;
    for (PetscInt a = 0; a < d->dim; a++) d->weight[q] *= weight[at[a]];
    for (PetscInt j = 0; j < d->nv; j++) {
      PetscReal f[3], g[3];

      for (PetscInt a = 0; a < d->dim; a++) {
        g[a] = (j >> a & 1) ? 0.5 : -0.5;
        f[a] = 0.5 + g[a] * point[at[a]];
      }
      d->phi[q][j] = 1;
      for (PetscInt a = 0; a < d->dim; a++) d->phi[q][j] *= f[a];
      for (PetscInt a = 0; a < d->dim; a++) {
        d->dphi[q][j][a] = g[a];
        for (PetscInt e = 0; e < d->dim; e++)
          if (e != a) d->dphi[q][j][a] *= f[e];
      }
    }
  }
}

/* Jacobian matrix dx_a/dxi_b of vertices xv with gradients g of the vertex functions */
static void map_gradient(const Deform *d, PetscReal xv[][3], const PetscReal g[][3], PetscReal jac[])
{
  for (PetscInt a = 0; a < d->dim; a++)
    for (PetscInt b = 0; b < d->dim; b++) {
      jac[a * d->dim + b] = 0;
      for (PetscInt j = 0; j < d->nv; j++) jac[a * d->dim + b] += xv[j][a] * g[j][b];
    }
}

static PetscErrorCode get_vertices(const Deform *d, PetscInt c, PetscReal xv[][3])
{
  PetscReal xc[MESH_MAX_NB * 3];

  PetscFunctionBeginUser;
  PetscCall(MeshCellCoordinates(d->mesh, c, xc));
  for (PetscInt j = 0; j < d->nv; j++)
    for (PetscInt a = 0; a < d->dim; a++) xv[j][a] = xc[d->corner[j] * d->dim + a];
  PetscFunctionReturn(PETSC_SUCCESS);
}

static inline PetscInt vertex(const Deform *d, PetscInt c, PetscInt j)
{
  return d->l->cell_node[c * d->l->nb + d->corner[j]];
}

/* ---- monitor ---- */

/* Wanted size over k times the size at the start, at x [dim]. A product over the bodies is smooth also where two of them are equally far. */
static PetscErrorCode evaluate_monitor(const Deform *d, const PetscReal x[], PetscReal *m)
{
  const PetscReal X[3] = {x[0], x[1], d->dim == 3 ? x[2] : 0};
  PetscReal       rise = 1, h;

  PetscFunctionBeginUser;
  for (PetscInt e = CellsFirst(d->near, X); e >= 0; e = CellsNext(d->near, e)) {
    PetscReal t;

    PetscCall(BodiesDistance(d->bodies, CellsItem(d->near, e), NULL, NULL, 1, x, &t));
    t = PetscMin(1, PetscAbsReal(t) / d->width);
    rise *= t * t * (3 - 2 * t);
  }
  h  = d->size + (1 - d->size) * rise;
  *m = d->dim == 2 ? h * h : h * h * h;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode list_bodies(Deform *d)
{
  const MeshLocal *l = d->l;

  PetscFunctionBeginUser;
  PetscCall(CellsCreate(d->dim, l->lower, l->upper, d->width, 1 << 20, &d->near));
  for (PetscInt k = 0; k < d->s->n; k++) PetscCall(CellsInsert(d->near, k, d->s->x[k], d->s->group[d->s->body_group[k]].radius + d->width));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- one step ---- */

/* Integrals of the vertex functions over 1/m and rho, and over the domain the scale k. Collective. */
static PetscErrorCode measure(Deform *d)
{
  const MeshLocal *l      = d->l;
  PetscReal        sum[2] = {0, 0};

  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(d->rest, l->nnode_all));
  PetscCall(PetscArrayzero(d->load, l->nnode_all));
  for (PetscInt c = 0; c < l->ncell_all; c++) {
    PetscReal xv[MAX_NV][3], share[MAX_NV] = {0}, size = 0, number = 0;

    PetscCall(get_vertices(d, c, xv));
    for (PetscInt q = 0; q < d->nq; q++) {
      PetscReal jac[9], x[3] = {0, 0, 0}, weight, m;

      map_gradient(d, xv, d->dphi[q], jac);
      weight = d->weight[q] * DenseDeterminant(d->dim, jac);
      for (PetscInt j = 0; j < d->nv; j++)
        for (PetscInt a = 0; a < d->dim; a++) x[a] += d->phi[q][j] * xv[j][a];
      PetscCall(evaluate_monitor(d, x, &m));
      size += weight;
      number += weight / m;
      for (PetscInt j = 0; j < d->nv; j++) {
        share[j] += weight * d->phi[q][j];
        d->rest[vertex(d, c, j)] += weight * d->phi[q][j] / m;
      }
    }
    for (PetscInt j = 0; j < d->nv; j++) d->load[vertex(d, c, j)] += share[j] * d->carried[c] / size;
    if (c < l->ncell) {
      sum[0] += number;
      sum[1] += d->carried[c];
    }
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 2, MPIU_REAL, MPIU_SUM, PETSC_COMM_WORLD));
  d->scale = sum[0] / sum[1];
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Sizes achieved over wanted, and the smallest Jacobian over its cell's mean, with its place. Collective. */
static PetscErrorCode judge(Deform *d, DeformResult *r, PetscReal where[3])
{
  const MeshLocal *l      = d->l;
  PetscReal        top[3] = {0, 0, -PETSC_MAX_REAL}, mine; /* wanted over achieved, achieved over wanted, -Jacobian */

  PetscFunctionBeginUser;
  for (PetscInt c = 0; c < l->ncell; c++) {
    PetscReal xv[MAX_NV][3], size = 0, number = 0, least = PETSC_MAX_REAL, mean;

    PetscCall(get_vertices(d, c, xv));
    for (PetscInt q = 0; q < d->nq; q++) {
      PetscReal jac[9], x[3] = {0, 0, 0}, det, m;

      map_gradient(d, xv, d->dphi[q], jac);
      det   = DenseDeterminant(d->dim, jac);
      least = PetscMin(least, det);
      for (PetscInt j = 0; j < d->nv; j++)
        for (PetscInt a = 0; a < d->dim; a++) x[a] += d->phi[q][j] * xv[j][a];
      PetscCall(evaluate_monitor(d, x, &m));
      size += d->weight[q] * det;
      number += d->weight[q] * det / m;
    }
    for (PetscInt k = 0; k < d->nv; k++) { /* corners: differences along the edges that meet there */
      PetscReal jac[9];

      for (PetscInt b = 0; b < d->dim; b++)
        for (PetscInt a = 0; a < d->dim; a++) jac[a * d->dim + b] = 0.5 * (xv[k | 1 << b][a] - xv[k & ~(1 << b)][a]);
      least = PetscMin(least, DenseDeterminant(d->dim, jac));
    }
    mean   = size / (1 << d->dim);
    least  = mean > 0 ? least / mean : -1; /* a cell turned inside out has a ratio of 1 too */
    number = number / d->scale / d->carried[c];
    top[0] = PetscMax(top[0], 1 / number);
    top[1] = PetscMax(top[1], number);
    if (-least > top[2]) {
      top[2] = -least;
      for (PetscInt a = 0; a < 3; a++) where[a] = a < d->dim ? xv[0][a] : 0;
    }
  }
  mine = top[2];
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, top, 3, MPIU_REAL, MPIU_MAX, PETSC_COMM_WORLD));
  if (mine < top[2]) where[0] = where[1] = where[2] = -PETSC_MAX_REAL;
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, where, 3, MPIU_REAL, MPIU_MAX, PETSC_COMM_WORLD));
  r->area[0]  = 1 / top[0];
  r->area[1]  = top[1];
  r->jacobian = -top[2];
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode assemble(Deform *d)
{
  const MeshLocal *l        = d->l;
  PetscReal        diameter = 0;

  PetscFunctionBeginUser;
  for (PetscInt a = 0; a < d->dim; a++) diameter = PetscMax(diameter, l->upper[a] - l->lower[a]);
  PetscCall(MatZeroEntries(d->K));
  for (PetscInt c = 0; c < l->ncell; c++) {
    PetscReal xv[MAX_NV][3], ke[MAX_NV * MAX_NV] = {0};
    PetscInt  row[MAX_NV];

    PetscCall(get_vertices(d, c, xv));
    for (PetscInt q = 0; q < d->nq; q++) {
      PetscReal jac[9], inv[9], g[MAX_NV][3], weight;

      map_gradient(d, xv, d->dphi[q], jac);
      weight = d->weight[q] * DenseInvertMap(d->dim, jac, inv);
      for (PetscInt j = 0; j < d->nv; j++)
        for (PetscInt a = 0; a < d->dim; a++) {
          g[j][a] = 0;
          for (PetscInt b = 0; b < d->dim; b++) g[j][a] += inv[b * d->dim + a] * d->dphi[q][j][b];
        }
      for (PetscInt i = 0; i < d->nv; i++)
        for (PetscInt j = 0; j < d->nv; j++) {
          PetscReal sum = REGULARISE / (diameter * diameter) * d->phi[q][i] * d->phi[q][j];

          for (PetscInt a = 0; a < d->dim; a++) sum += g[i][a] * g[j][a];
          ke[i * d->nv + j] += weight * sum;
        }
    }
    for (PetscInt j = 0; j < d->nv; j++) row[j] = d->number[vertex(d, c, j)];
    PetscCall(MatSetValues(d->K, d->nv, row, d->nv, row, ke, ADD_VALUES));
  }
  PetscCall(MatAssemblyBegin(d->K, MAT_FINAL_ASSEMBLY));
  PetscCall(MatAssemblyEnd(d->K, MAT_FINAL_ASSEMBLY));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The potential at all local nodes */
static PetscErrorCode solve_potential(Deform *d)
{
  const MeshLocal   *l = d->l;
  PetscScalar       *b;
  const PetscScalar *x;
  PetscReal          mean;
  PetscInt           n = 0;
  KSPConvergedReason reason;

  PetscFunctionBeginUser;
  PetscCall(assemble(d));
  PetscCall(VecGetArrayWrite(d->b, &b));
  for (PetscInt i = 0; i < l->nnode; i++)
    if (d->number[i] >= 0) b[n++] = d->rest[i] / d->scale - d->load[i];
  PetscCall(VecRestoreArrayWrite(d->b, &b));
  PetscCall(VecMean(d->b, &mean));
  PetscCall(VecShift(d->b, -mean)); /* round-off */
  PetscCall(KSPSolve(d->ksp, d->b, d->x));
  PetscCall(KSPGetConvergedReason(d->ksp, &reason));
  PetscCheck(reason > 0, PETSC_COMM_WORLD, PETSC_ERR_NOT_CONVERGED,
             "The potential of -mesh_deform was not found (%s): raise -deform_ksp_max_it, or choose another -deform_pc_type",
             KSPConvergedReasons[reason]);
  PetscCall(VecGetArrayRead(d->x, &x));
  n = 0;
  for (PetscInt i = 0; i < l->nnode; i++) d->w[i] = d->number[i] >= 0 ? x[n++] : 0;
  PetscCall(VecRestoreArrayRead(d->x, &x));
  PetscCall(MeshSyncNodes(d->mesh, 1, d->w));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* grad w / rho at the vertices: the gradient is the mean of that of the cells around, as is rho */
static PetscErrorCode find_velocity(Deform *d)
{
  const MeshLocal *l = d->l;

  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(d->v, l->nnode_all * d->dim));
  for (PetscInt c = 0; c < l->ncell_all; c++) {
    PetscReal xv[MAX_NV][3];

    PetscCall(get_vertices(d, c, xv));
    for (PetscInt q = 0; q < d->nq; q++) {
      PetscReal jac[9], inv[9], grad[3] = {0, 0, 0}, weight;

      map_gradient(d, xv, d->dphi[q], jac);
      weight = d->weight[q] * DenseInvertMap(d->dim, jac, inv);
      for (PetscInt j = 0; j < d->nv; j++)
        for (PetscInt a = 0; a < d->dim; a++)
          for (PetscInt b = 0; b < d->dim; b++) grad[a] += d->w[vertex(d, c, j)] * inv[b * d->dim + a] * d->dphi[q][j][b];
      for (PetscInt j = 0; j < d->nv; j++)
        for (PetscInt a = 0; a < d->dim; a++) d->v[vertex(d, c, j) * d->dim + a] += weight * d->phi[q][j] * grad[a];
    }
  }
  for (PetscInt i = 0; i < l->nnode; i++)
    for (PetscInt a = 0; a < d->dim; a++) {
      if (d->number[i] < 0 || (d->held[i] >> a & 1)) d->v[i * d->dim + a] = 0;
      else d->v[i * d->dim + a] /= d->load[i]; /* both are integrals of the vertex function: their ratio is that of the means */
    }
  PetscCall(MeshSyncNodes(d->mesh, d->dim, d->v));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Put every node between the vertices of its cell, with the vertices at `from` + t v */
static PetscErrorCode move_nodes(Deform *d, const PetscReal from[], PetscReal t)
{
  const MeshLocal *l = d->l;
  PetscInt        *node;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(l->nnode_all, &node));
  for (PetscInt i = 0; i < l->nnode_all; i++) node[i] = i;
  for (PetscInt i = 0; i < l->nnode_all * d->dim; i++) d->trial[i] = from[i] + t * d->v[i];
  PetscCall(MeshMoveNodes(d->mesh, l->nnode_all, node, d->trial));
  for (PetscInt c = 0; c < l->ncell_all; c++) {
    PetscReal xv[MAX_NV][3];

    PetscCall(get_vertices(d, c, xv));
    for (PetscInt i = 0; i < l->nb; i++) {
      const PetscInt at[3] = {i % 3, i / 3 % 3, i / 9};
      PetscReal      x[3] = {0, 0, 0}, *y = d->trial + l->cell_node[c * l->nb + i] * d->dim;

      if (d->number[l->cell_node[c * l->nb + i]] >= 0) continue;
      for (PetscInt j = 0; j < d->nv; j++) {
        PetscReal weight = 1;

        for (PetscInt a = 0; a < d->dim; a++) weight *= (j >> a & 1) ? 0.5 * at[a] : 1 - 0.5 * at[a];
        for (PetscInt a = 0; a < d->dim; a++) x[a] += weight * xv[j][a];
      }
      for (PetscInt a = 0; a < d->dim; a++) y[a] = x[a];
    }
  }
  PetscCall(MeshSyncNodes(d->mesh, d->dim, d->trial));
  PetscCall(MeshMoveNodes(d->mesh, l->nnode_all, node, d->trial));
  PetscCall(PetscFree(node));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* A part of the way from the present to the wanted sizes; shorter if cells would become too slender. *taken: what it was. */
static PetscErrorCode take_step(Deform *d, PetscReal part, PetscReal *taken, DeformResult *r)
{
  const PetscInt size = d->l->nnode_all * d->dim;
  PetscReal     *from, where[3] = {0, 0, 0};

  PetscFunctionBeginUser;
  PetscCall(solve_potential(d));
  PetscCall(find_velocity(d));
  PetscCall(PetscMalloc1(size, &from));
  PetscCall(PetscArraycpy(from, d->l->x, size));
  for (*taken = part;; *taken *= 0.5) {
    PetscCall(move_nodes(d, from, *taken));
    PetscCall(measure(d));
    PetscCall(judge(d, r, where));
    if (r->jacobian > SAFE) break;
    PetscCheck(*taken > 1e-3 * part, PETSC_COMM_WORLD, PETSC_ERR_USER_INPUT,
               "-mesh_deform would tangle the mesh: near (%g, %g) a cell is left with a Jacobian of %g of its mean. Raise -mesh_deform_size (now %g), -mesh_deform_width "
               "(now %g) or the number of cells between the bodies",
               (double)where[0], (double)where[1], (double)r->jacobian, (double)d->size, (double)d->width);
  }
  PetscCall(PetscFree(from));
  r->steps++;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* From the mesh as it is to the wanted one; then corrections until they no longer help */
static PetscErrorCode deform(Deform *d, DeformResult *r)
{
  PetscReal taken, error = PETSC_MAX_REAL;

  PetscFunctionBeginUser;
  r->steps = 0;
  PetscCall(measure(d));
  for (PetscInt k = 0; k < d->steps; k++) PetscCall(take_step(d, 1. / (d->steps - k), &taken, r));
  for (PetscInt k = 0; k < CORRECT; k++) {
    const PetscReal last = error;

    error = PetscMax(1 - r->area[0], r->area[1] - 1);
    if (error < GOOD || error > 0.95 * last) break;
    PetscCall(take_step(d, 1, &taken, r));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- preparation ---- */

/* Nodes on a face of the box stay on it; every named boundary must be part of one. Sizes of the cells, which must have straight sides. */
static PetscErrorCode hold_boundaries(Deform *d)
{
  const MeshLocal *l = d->l;
  PetscInt         n;

  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(d->held, l->nnode_all));
  for (PetscInt i = 0; i < l->nnode_all * d->dim; i++) {
    const PetscInt  a   = i % d->dim;
    const PetscReal eps = 1e-8 * (l->upper[a] - l->lower[a]);

    if (l->period[a] <= 0 && (l->x[i] < l->lower[a] + eps || l->x[i] > l->upper[a] - eps)) d->held[i / d->dim] |= 1 << a;
  }
  PetscCall(MeshGetBoundaryCount(d->mesh, &n));
  for (PetscInt b = 0; b < n; b++) {
    PetscInt        count, free = 0;
    const PetscInt *node;
    const char     *name;

    PetscCall(MeshGetBoundaryNodes(d->mesh, b, &count, &node));
    PetscCall(MeshGetBoundaryName(d->mesh, b, &name));
    for (PetscInt i = 0; i < count; i++) free |= !d->held[node[i]];
    PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &free, 1, MPIU_INT, MPI_MAX, PETSC_COMM_WORLD));
    PetscCheck(!free, PETSC_COMM_WORLD, PETSC_ERR_SUP,
               "-mesh_deform needs a box: boundary '%s' is not on its faces, and nodes could not slide along it. Use -mesh_kind box or channel",
               name);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode measure_start(Deform *d)
{
  PetscFunctionBeginUser;
  for (PetscInt c = 0; c < d->l->ncell_all; c++) {
    PetscReal xv[MAX_NV][3];

    PetscCall(get_vertices(d, c, xv));
    d->carried[c] = 0;
    for (PetscInt q = 0; q < d->nq; q++) {
      PetscReal jac[9];

      map_gradient(d, xv, d->dphi[q], jac);
      d->carried[c] += d->weight[q] * DenseDeterminant(d->dim, jac);
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode create_solver(Deform *d)
{
  const PetscInt most = d->dim == 2 ? 9 : 27;
  PC             pc;

  PetscFunctionBeginUser;
  PetscCall(MatCreateAIJ(PETSC_COMM_WORLD, d->nvertex, d->nvertex, PETSC_DETERMINE, PETSC_DETERMINE, most, NULL, most, NULL, &d->K));
  PetscCall(MatSetOption(d->K, MAT_NEW_NONZERO_ALLOCATION_ERR, PETSC_FALSE)); /* meshes of files may have more cells around a vertex */
  PetscCall(MatCreateVecs(d->K, &d->x, &d->b));
  PetscCall(KSPCreate(PETSC_COMM_WORLD, &d->ksp));
  PetscCall(KSPSetOptionsPrefix(d->ksp, "deform_"));
  PetscCall(KSPSetType(d->ksp, KSPCG));
  PetscCall(KSPSetOperators(d->ksp, d->K, d->K));
  PetscCall(KSPSetTolerances(d->ksp, 1e-8, PETSC_DEFAULT, PETSC_DEFAULT, 1000));
  PetscCall(KSPGetPC(d->ksp, &pc));
  PetscCall(PCSetType(pc, PCGAMG));
  PetscCall(OptDefault("-deform_pc_gamg_reuse_interpolation", "false")); /* cells change too much between solves */
  PetscCall(KSPSetFromOptions(d->ksp));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode read_options(Deform *d)
{
  PetscReal radius = 0;

  PetscFunctionBeginUser;
  for (PetscInt g = 0; g < d->s->ngroups; g++) radius = PetscMax(radius, d->s->group[g].radius);
  d->size  = 0.4;
  d->width = radius;
  d->steps = 30;
  PetscCall(OptReal("-mesh_deform_size", "size of cells at the surface of a body over that far away", "", 0.1, 1, &d->size));
  PetscCall(OptReal("-mesh_deform_width", "distance from the surface at which cells keep their size (default: radius of the largest body)", "length",
                    OPT_POSITIVE, PETSC_MAX_REAL, &d->width));
  PetscCall(OptInt("-mesh_deform_steps", "steps of pseudo-time of the deformation", "", 1, 1000, &d->steps));
  PetscCheck(d->s->n, PETSC_COMM_WORLD, PETSC_ERR_USER_INPUT,
             "-mesh_deform has no bodies to concentrate cells at: add a group, or remove the option");
  for (PetscInt g = 0; g < d->s->ngroups; g++)
    PetscCheck(!d->s->group[g].free && !d->s->group[g].motion.given, PETSC_COMM_WORLD, PETSC_ERR_SUP,
               "-mesh_deform follows no moving bodies, and group '%s' moves: fix it (-particle_%s_free none), or use -mesh_focus where it will be",
               d->s->group[g].name, d->s->group[g].name);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DeformMesh(Mesh mesh, Bodies bodies, PetscBool *done, DeformResult *r)
{
  Deform d = {.mesh = mesh, .bodies = bodies};

  PetscFunctionBeginUser;
  *done = PETSC_FALSE;
  PetscCall(OptBool("-mesh_deform", "concentrate cells near bodies that stand still", done));
  if (!*done) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(BodiesGetState(bodies, &d.s));
  PetscCall(MeshGetLocal(mesh, &d.l));
  d.dim = d.l->dim;
  PetscCall(read_options(&d));
  tabulate(&d);
  PetscCall(PetscMalloc3(d.l->nnode_all, &d.number, d.l->nnode_all, &d.held, d.l->ncell_all, &d.carried));
  PetscCall(PetscMalloc5(d.l->nnode_all, &d.rest, d.l->nnode_all, &d.load, d.l->nnode_all, &d.w, d.l->nnode_all * d.dim, &d.v, d.l->nnode_all * d.dim,
                         &d.trial));
  PetscCall(MeshNumberVertices(mesh, d.number, &d.nvertex));
  PetscCall(hold_boundaries(&d));
  PetscCall(measure_start(&d));
  PetscCall(list_bodies(&d));
  PetscCall(create_solver(&d));
  PetscCall(deform(&d, r));
  PetscCall(MeshRebase(mesh));
  PetscCall(CellsDestroy(&d.near));
  PetscCall(KSPDestroy(&d.ksp));
  PetscCall(MatDestroy(&d.K));
  PetscCall(VecDestroy(&d.x));
  PetscCall(VecDestroy(&d.b));
  PetscCall(PetscFree3(d.number, d.held, d.carried));
  PetscCall(PetscFree5(d.rest, d.load, d.w, d.v, d.trial));
  PetscFunctionReturn(PETSC_SUCCESS);
}
