/* Deform: see deform.h. Ghost cells are computed like own ones, so that own vertices see all their cells. */
#include "compat.h"
#include "impl.h"
#include "base/opt.h"
#include "base/array.h"
#include "fem/gauss.h"

#define SAFE             0.1  /* smallest Jacobian over the mean of its cell */
#define CORRECT          12   /* further steps at most, until */
#define GOOD             0.02 /* sizes are so close to the wanted ones */
#define MAX_STEPS_BEHIND 4    /* steps at most behind bodies that moved, until */
#define CLOSE            0.05 /* sizes are so close */
/* relaxation over the change of sizes by the way of the bodies: in proportion to it, however long the step */
#define RELAX  2
#define PASSES 2 /* of smoothing of the displacements on the way */

/* Displacements of a step: those that the sizes want; these smoothed; the relaxation with what the sizes then want */
typedef enum {
  EXACT,
  SMOOTHED,
  RELAXED
} Kind;

/* ---- elements ---- */

static void tabulate(Deform d)
{
  d->element.nv = 1 << d->dim;
  d->element.nq = d->dim == 2 ? 9 : 27;
  for (PetscInt j = 0; j < d->element.nv; j++) d->element.corner[j] = 2 * (j & 1) + 6 * (j >> 1 & 1) + 18 * (j >> 2);
  for (PetscInt q = 0; q < d->element.nq; q++) {
    const PetscInt at[3] = {q % 3, q / 3 % 3, q / 9};

    d->element.weight[q] = 1;
    for (PetscInt a = 0; a < d->dim; a++) d->element.weight[q] *= GAUSS3_WEIGHT[at[a]];
    for (PetscInt j = 0; j < d->element.nv; j++) {
      PetscReal f[3], g[3];

      for (PetscInt a = 0; a < d->dim; a++) {
        g[a] = (j >> a & 1) ? 0.5 : -0.5;
        f[a] = 0.5 + g[a] * GAUSS3_POINT[at[a]];
      }
      d->element.phi[q][j] = 1;
      for (PetscInt a = 0; a < d->dim; a++) d->element.phi[q][j] *= f[a];
      for (PetscInt a = 0; a < d->dim; a++) {
        d->element.dphi[q][j][a] = g[a];
        for (PetscInt e = 0; e < d->dim; e++)
          if (e != a) d->element.dphi[q][j][a] *= f[e];
      }
    }
  }
}

PetscErrorCode DeformGetVertices(const struct _p_Deform *d, PetscInt c, PetscReal xv[][3])
{
  PetscReal xc[MESH_MAX_NB * 3];

  PetscFunctionBeginUser;
  PetscCall(MeshCellCoordinates(d->mesh, c, xc));
  for (PetscInt j = 0; j < d->element.nv; j++)
    for (PetscInt a = 0; a < d->dim; a++) xv[j][a] = xc[d->element.corner[j] * d->dim + a];
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- monitor ---- */

PetscErrorCode DeformEvaluateMonitor(const struct _p_Deform *d, const PetscReal x[], PetscReal *m)
{
  const PetscReal       at[3] = {x[0], x[1], d->dim == 3 ? x[2] : 0};
  PetscReal             rise  = 1, h;
  const DeformSurfaces *s     = d->surfaces;

  PetscFunctionBeginUser;
  for (PetscInt e = GridFirst(d->near.grid, at); e >= 0; e = GridNext(d->near.grid, e)) {
    PetscReal t;

    PetscCall(
      s->distance(s->ctx, d->near.surface[GridItem(d->near.grid, e)], d->near.at[GridItem(d->near.grid, e)], 1, x, &t));
    t = PetscMin(1, PetscAbsReal(t) / d->width);
    rise *= t * t * (3 - 2 * t);
  }
  h  = d->size + (1 - d->size) * rise;
  *m = d->dim == 2 ? h * h : h * h * h;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Surface k, with all its images whose surroundings reach the domain */
static PetscErrorCode list_surface(Deform d, PetscInt k)
{
  const PetscReal reach = d->surfaces->radius[k] + d->width;

  PetscFunctionBeginUser;
  for (DomainImages i = {0}; MeshNextImage(d->l, d->surfaces->centre[k], reach + d->width, &i);) {
    PetscCall(ArrayReserve(d->near.n + 1, &d->near.capacity, &d->near.surface, sizeof(*d->near.surface), &d->near.at,
                           sizeof(*d->near.at), NULL));
    d->near.surface[d->near.n] = k;
    PetscCall(PetscArraycpy(d->near.at[d->near.n], i.at, 3));
    PetscCall(GridInsert(d->near.grid, d->near.n++, i.at, reach));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode list_surfaces(Deform d)
{
  const MeshLocal *l = d->l;

  PetscFunctionBeginUser;
  PetscCall(GridDestroy(&d->near.grid));
  PetscCall(GridCreate(d->dim, l->lower, l->upper, d->width, 1 << 20, &d->near.grid));
  d->near.n = 0;
  for (PetscInt k = 0; k < d->surfaces->n; k++)
    if (!d->surfaces->removed || !d->surfaces->removed[k]) PetscCall(list_surface(d, k));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* A surface counts within its width of a node; behind bodies that turn nodes go less than a radius in a step */
PetscErrorCode DeformLook(Deform d)
{
  PetscReal farthest = 0; /* square of the way of a node from the start */

  PetscFunctionBeginUser;
  if (!d->surfaces->look) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt i = 0; i < d->l->nnode_all; i++) {
    PetscReal sum = 0;

    for (PetscInt a = 0; a < d->dim; a++)
      sum += PetscSqr(MeshNearest(d->l, a, d->l->x[i * d->dim + a] - d->node.start[i * d->dim + a]));
    farthest = PetscMax(farthest, sum);
  }
  PetscCall(d->surfaces->look(d->surfaces->ctx, PetscSqrtReal(farthest) + d->width + d->surfaces->largest));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The surfaces where they are; nodes may have come near others than before */
static PetscErrorCode update_surfaces(Deform d)
{
  PetscFunctionBeginUser;
  PetscCall(DeformLook(d));
  if (d->surfaces->update_local) PetscCall(d->surfaces->update_local(d->surfaces->ctx));
  PetscCall(list_surfaces(d));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- one step ---- */

/* Smallest Jacobian of a cell at Gauss points and corners over its mean; a cell turned inside out gives -1 */
static PetscReal find_min_jacobian(const struct _p_Deform *d, PetscReal xv[][3], PetscReal size)
{
  const PetscReal mean = size / (1 << d->dim);
  PetscReal       min  = PETSC_MAX_REAL, jac[9];

  for (PetscInt q = 0; q < d->element.nq; q++) {
    DeformMapGradient(d, xv, d->element.dphi[q], jac);
    min = PetscMin(min, DenseDeterminant(d->dim, jac));
  }
  for (PetscInt k = 0; k < d->element.nv; k++) { /* corners: differences along the edges that meet there */
    for (PetscInt b = 0; b < d->dim; b++)
      for (PetscInt a = 0; a < d->dim; a++) jac[a * d->dim + b] = 0.5 * (xv[k | 1 << b][a] - xv[k & ~(1 << b)][a]);
    min = PetscMin(min, DenseDeterminant(d->dim, jac));
  }
  return mean > 0 ? min / mean : -1;
}

/* Sizes and integrals of 1/m of all local cells, and over the domain the scale k. Collective. */
static PetscErrorCode measure_sizes(Deform d)
{
  const MeshLocal *l      = d->l;
  PetscReal        sum[2] = {0, 0};

  PetscFunctionBeginUser;
  if (d->meets) PetscCall(update_surfaces(d));
  for (PetscInt c = 0; c < l->ncell_all; c++) {
    PetscReal xv[MAX_NV][3];

    PetscCall(DeformGetVertices(d, c, xv));
    d->cell.now[c] = d->cell.count[c] = 0;
    for (PetscInt q = 0; q < d->element.nq; q++) {
      PetscReal jac[9], x[3] = {0, 0, 0}, weight, m;

      DeformMapGradient(d, xv, d->element.dphi[q], jac);
      weight = d->element.weight[q] * DenseDeterminant(d->dim, jac);
      for (PetscInt j = 0; j < d->element.nv; j++)
        for (PetscInt a = 0; a < d->dim; a++) x[a] += d->element.phi[q][j] * xv[j][a];
      PetscCall(DeformEvaluateMonitor(d, x, &m));
      d->cell.now[c] += weight;
      d->cell.count[c] += weight / m;
    }
    if (c < l->ncell) {
      sum[0] += d->cell.count[c];
      sum[1] += d->cell.start[c];
    }
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 2, MPIU_REAL, MPIU_SUM, d->comm));
  d->scale = sum[0] / sum[1];
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* After measure_sizes: sizes over wanted ones, the smallest Jacobian over its cell's mean, and where. Collective. */
static PetscErrorCode check_cells(Deform d, DeformResult *r, PetscReal where[3])
{
  const MeshLocal *l      = d->l;
  PetscReal        top[3] = {0, 0, -PETSC_MAX_REAL}, mine; /* wanted over achieved, achieved over wanted, -Jacobian */

  PetscFunctionBeginUser;
  for (PetscInt c = 0; c < l->ncell; c++) {
    const PetscReal ratio = d->cell.count[c] / d->scale / d->cell.start[c];
    PetscReal       xv[MAX_NV][3], min;

    PetscCall(DeformGetVertices(d, c, xv));
    min    = find_min_jacobian(d, xv, d->cell.now[c]);
    top[0] = PetscMax(top[0], 1 / ratio);
    top[1] = PetscMax(top[1], ratio);
    if (-min <= top[2]) continue;
    top[2] = -min;
    for (PetscInt a = 0; a < 3; a++) where[a] = a < d->dim ? xv[0][a] : 0;
  }
  mine = top[2];
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, top, 3, MPIU_REAL, MPIU_MAX, d->comm));
  if (mine < top[2]) where[0] = where[1] = where[2] = -PETSC_MAX_REAL;
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, where, 3, MPIU_REAL, MPIU_MAX, d->comm));
  r->area[0]  = 1 / top[0];
  r->area[1]  = top[1];
  r->jacobian = -top[2];
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Replace the displacements v [nnode_all][dim] of vertices by the means over the cells around of the cells' means */
static PetscErrorCode smooth_displacement(Deform d, PetscReal v[])
{
  const MeshLocal *l = d->l;
  PetscReal       *sum, *mass;

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc2(l->nnode_all * d->dim, &sum, l->nnode_all, &mass));
  for (PetscInt c = 0; c < l->ncell_all; c++) {
    PetscReal mean[3] = {0, 0, 0};

    for (PetscInt i = 0; i < d->element.nv * d->dim; i++)
      mean[i % d->dim] += v[DeformVertex(d, c, i / d->dim) * d->dim + i % d->dim] / d->element.nv;
    for (PetscInt j = 0; j < d->element.nv; j++) {
      mass[DeformVertex(d, c, j)] += d->cell.start[c];
      for (PetscInt a = 0; a < d->dim; a++) sum[DeformVertex(d, c, j) * d->dim + a] += d->cell.start[c] * mean[a];
    }
  }
  for (PetscInt i = 0; i < l->nnode * d->dim; i++)
    v[i] = d->node.vertex[i / d->dim] && !(d->node.fixed[i / d->dim] >> i % d->dim & 1) ? sum[i] / mass[i / d->dim] : 0;
  PetscCall(MeshSyncNodes(d->mesh, d->dim, v));
  PetscCall(PetscFree2(sum, mass));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* A fraction of what smoothing would change in the displacements from the start */
static PetscErrorCode find_relaxation(Deform d, PetscReal fraction)
{
  const PetscInt size = d->l->nnode_all * d->dim;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < size; i++) d->node.relax[i] = d->l->x[i] - d->node.start[i];
  for (PetscInt i = 0; i < PASSES; i++) PetscCall(smooth_displacement(d, d->node.relax));
  for (PetscInt i = 0; i < size; i++)
    d->node.relax[i] = d->node.vertex[i / d->dim] ? fraction * (d->node.relax[i] - (d->l->x[i] - d->node.start[i])) : 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Put every node between the vertices of its cell, with the vertices at `from` + t v */
static PetscErrorCode move_nodes(Deform d, const PetscReal from[], PetscReal t)
{
  const MeshLocal *l = d->l;
  PetscInt        *node;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(l->nnode_all, &node));
  for (PetscInt i = 0; i < l->nnode_all; i++) node[i] = i;
  for (PetscInt i = 0; i < l->nnode_all * d->dim; i++) d->node.trial[i] = from[i] + t * d->node.v[i];
  PetscCall(MeshMoveNodes(d->mesh, l->nnode_all, node, d->node.trial));
  for (PetscInt c = 0; c < l->ncell_all; c++) {
    PetscReal xv[MAX_NV][3];

    PetscCall(DeformGetVertices(d, c, xv));
    for (PetscInt i = 0; i < l->nb; i++) {
      const PetscInt at[3] = {i % 3, i / 3 % 3, i / 9};
      PetscReal      x[3] = {0, 0, 0}, *y = d->node.trial + l->cell_node[c * l->nb + i] * d->dim;

      if (d->node.vertex[l->cell_node[c * l->nb + i]]) continue;
      for (PetscInt j = 0; j < d->element.nv; j++) {
        PetscReal weight = 1;

        for (PetscInt a = 0; a < d->dim; a++) weight *= (j >> a & 1) ? 0.5 * at[a] : 1 - 0.5 * at[a];
        for (PetscInt a = 0; a < d->dim; a++) x[a] += weight * xv[j][a];
      }
      for (PetscInt a = 0; a < d->dim; a++) y[a] = x[a];
    }
  }
  PetscCall(MeshSyncNodes(d->mesh, d->dim, d->node.trial));
  PetscCall(MeshMoveNodes(d->mesh, l->nnode_all, node, d->node.trial));
  PetscCall(PetscFree(node));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* A part of the way to the wanted sizes, a shorter one if cells would become too slender. */
static PetscErrorCode take_step(Deform d, Kind kind, PetscReal step_fraction, DeformResult *r)
{
  const PetscInt size = d->l->nnode_all * d->dim;
  PetscReal     *from, where[3] = {0, 0, 0};

  PetscFunctionBeginUser;
  if (kind == RELAXED) PetscCall(find_relaxation(d, d->fraction));
  else PetscCall(PetscArrayzero(d->node.relax, size));
  PetscCall(DeformSolvePotential(d));
  PetscCall(DeformFindDisplacement(d));
  for (PetscInt i = 0; i < PASSES && kind == SMOOTHED; i++) PetscCall(smooth_displacement(d, d->node.v));
  PetscCall(PetscMalloc1(size, &from));
  PetscCall(PetscArraycpy(from, d->l->x, size));
  for (PetscReal taken = step_fraction;; taken *= 0.5) {
    PetscCall(move_nodes(d, from, taken));
    PetscCall(measure_sizes(d));
    PetscCall(check_cells(d, r, where));
    if (r->jacobian > SAFE) break;
    PetscCheck(taken > 1e-3 * step_fraction, d->comm, PETSC_ERR_USER_INPUT,
               "-mesh_deform would tangle the mesh: near (%g, %g) a cell is left with a Jacobian of %g of its mean. Raise -mesh_deform_size (now %g), -mesh_deform_width "
               "(now %g) or the number of cells between the bodies",
               (double)where[0], (double)where[1], (double)r->jacobian, (double)d->size, (double)d->width);
  }
  PetscCall(PetscFree(from));
  r->steps++;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- preparation ---- */

/* Nodes on a face of the box stay on it; every named boundary must be part of one. Sizes of the cells, which must
   have straight sides. */
static PetscErrorCode fix_boundaries(Deform d)
{
  const MeshLocal *l = d->l;
  PetscInt         n;

  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(d->node.fixed, l->nnode_all));
  for (PetscInt i = 0; i < l->nnode_all * d->dim; i++) {
    const PetscInt  a   = i % d->dim;
    const PetscReal eps = 1e-8 * (l->upper[a] - l->lower[a]);

    if (l->period[a] <= 0 && (l->x[i] < l->lower[a] + eps || l->x[i] > l->upper[a] - eps))
      d->node.fixed[i / d->dim] |= 1 << a;
  }
  PetscCall(MeshGetBoundaryCount(d->mesh, &n));
  for (PetscInt b = 0; b < n; b++) {
    PetscInt        count, free = 0;
    const PetscInt *node;
    const char     *name;

    PetscCall(MeshGetBoundaryNodes(d->mesh, b, &count, &node));
    PetscCall(MeshGetBoundaryName(d->mesh, b, &name));
    for (PetscInt i = 0; i < count; i++) free |= !d->node.fixed[node[i]];
    PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &free, 1, MPIU_INT, MPI_MAX, d->comm));
    PetscCheck(!free, d->comm, PETSC_ERR_SUP,
               "-mesh_deform needs a box: boundary '%s' is not on its faces, and nodes could not slide along it. Use -mesh_kind box or channel",
               name);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode measure_start(Deform d)
{
  PetscFunctionBeginUser;
  for (PetscInt c = 0; c < d->l->ncell_all; c++) {
    PetscReal xv[MAX_NV][3];

    PetscCall(DeformGetVertices(d, c, xv));
    d->cell.start[c] = 0;
    for (PetscInt j = 0; j < d->element.nv; j++) d->node.vertex[DeformVertex(d, c, j)] = PETSC_TRUE;
    for (PetscInt q = 0; q < d->element.nq; q++) {
      PetscReal jac[9];

      DeformMapGradient(d, xv, d->element.dphi[q], jac);
      d->cell.start[c] += d->element.weight[q] * DenseDeterminant(d->dim, jac);
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode create_solver(Deform d)
{
  const PetscInt max = d->dim == 2 ? 9 : 27;
  PC             pc;

  PetscFunctionBeginUser;
  PetscCall(
    MatCreateAIJ(d->comm, d->l->ncell, d->l->ncell, PETSC_DETERMINE, PETSC_DETERMINE, max, NULL, max, NULL, &d->K));
  /* meshes of files may have more cells around a vertex */
  PetscCall(MatSetOption(d->K, MAT_NEW_NONZERO_ALLOCATION_ERR, PETSC_FALSE));
  PetscCall(MatCreateVecs(d->K, &d->x, &d->b));
  PetscCall(KSPCreate(d->comm, &d->ksp));
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

static PetscErrorCode read_options(Deform d)
{
  PetscFunctionBeginUser;
  d->size  = 0.4;
  d->width = d->surfaces->largest;
  d->steps = 30;
  PetscCall(OptReal("-mesh_deform_size", &d->size));
  PetscCall(OptReal("-mesh_deform_width", &d->width));
  PetscCall(OptInt("-mesh_deform_steps", &d->steps));
  PetscCheck(d->surfaces->nall, d->comm, PETSC_ERR_USER_INPUT,
             "-mesh_deform has no bodies to concentrate cells at: add a group, or remove the option");
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- public ---- */

static PetscErrorCode destroy_surfaces(const DeformSurfaces *s)
{
  PetscFunctionBeginUser;
  if (s && s->destroy) PetscCall(s->destroy(s->ctx));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DeformSetSurfaces(Deform d, const DeformSurfaces *surfaces)
{
  PetscFunctionBeginUser;
  PetscCall(destroy_surfaces(d->surfaces));
  d->surfaces = surfaces;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DeformCreate(Mesh mesh, const DeformSurfaces *surfaces, Deform *deform)
{
  Deform    d;
  PetscInt  n, m;
  PetscBool wanted = PETSC_FALSE;

  PetscFunctionBeginUser;
  *deform = NULL;
  PetscCall(OptBool("-mesh_deform", &wanted));
  if (!wanted) {
    PetscCall(destroy_surfaces(surfaces));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(PetscNew(&d));
  *deform     = d;
  d->mesh     = mesh;
  d->surfaces = surfaces;
  PetscCall(MeshGetComm(mesh, &d->comm));
  PetscCall(MeshGetLocal(mesh, &d->l));
  PetscCheck(!d->l->hang, d->comm, PETSC_ERR_SUP,
             "-mesh_deform does not move the cells of a refined mesh: remove it or -mesh_levels");
  d->dim = d->l->dim;
  PetscCall(read_options(d));
  tabulate(d);
  n = d->l->nnode_all;
  m = d->l->ncell_all;
  PetscCall(PetscCalloc5(n, &d->node.vertex, n, &d->node.fixed, m, &d->cell.start, m, &d->cell.now, m, &d->cell.count));
  PetscCall(PetscMalloc6(m * d->element.nv * d->dim, &d->cell.slope, n, &d->node.inverse, n, &d->node.mobility, n,
                         &d->node.damp, n * d->dim, &d->node.v, n * d->dim, &d->node.trial));
  PetscCall(PetscMalloc2(n * d->dim, &d->node.start, n * d->dim, &d->node.relax));
  PetscCall(PetscArraycpy(d->node.start, d->l->x, n * d->dim));
  PetscCall(fix_boundaries(d));
  PetscCall(measure_start(d));
  PetscCall(create_solver(d));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DeformDestroy(Deform *deform)
{
  Deform d = *deform;

  PetscFunctionBeginUser;
  if (!d) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(destroy_surfaces(d->surfaces));
  PetscCall(GridDestroy(&d->near.grid));
  PetscCall(KSPDestroy(&d->ksp));
  PetscCall(MatDestroy(&d->K));
  PetscCall(VecDestroy(&d->x));
  PetscCall(VecDestroy(&d->b));
  PetscCall(PetscFree5(d->node.vertex, d->node.fixed, d->cell.start, d->cell.now, d->cell.count));
  PetscCall(PetscFree6(d->cell.slope, d->node.inverse, d->node.mobility, d->node.damp, d->node.v, d->node.trial));
  PetscCall(PetscFree2(d->node.start, d->node.relax));
  PetscCall(PetscFree(d->near.surface));
  PetscCall(PetscFree(d->near.at));
  PetscCall(PetscFree(*deform));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DeformMesh(Deform d, DeformResult *r)
{
  PetscReal error = PETSC_MAX_REAL;

  PetscFunctionBeginUser;
  d->meets = PETSC_TRUE;
  r->steps = 0;
  PetscCall(measure_sizes(d));
  for (PetscInt k = 0; k < d->steps; k++) PetscCall(take_step(d, SMOOTHED, 1. / (d->steps - k), r));
  for (PetscInt k = 0; k < CORRECT; k++) {
    const PetscReal last = error;

    error = PetscMax(1 - r->area[0], r->area[1] - 1);
    if (error < GOOD || error > 0.95 * last) break;
    PetscCall(take_step(d, EXACT, 1, r));
  }
  d->meets = PETSC_FALSE;
  PetscCall(MeshRebase(d->mesh));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DeformUpdate(Deform d, DeformResult *r)
{
  PetscReal where[3] = {0, 0, 0};

  PetscFunctionBeginUser;
  PetscCall(list_surfaces(d));
  r->steps = 0;
  PetscCall(measure_sizes(d));
  PetscCall(check_cells(d, r, where));
  d->fraction = PetscMin(1, RELAX * PetscMax(1 - r->area[0], r->area[1] - 1));
  do PetscCall(take_step(d, r->steps ? EXACT : RELAXED, 1, r));
  while (r->steps < MAX_STEPS_BEHIND && (r->area[0] < 1 - CLOSE || r->area[1] > 1 + CLOSE));
  PetscFunctionReturn(PETSC_SUCCESS);
}
