/* What a membrane encloses, and the volume of a solid, is kept: see solid/element.h. */
#include "compat.h"
#include "solid/element.h"
#include "membrane.h"

#define VOLUME_IT  10
#define VOLUME_TOL 1e-13
#define FARTHEST   0.2  /* stretch */
#define ROUND      1e-3 /* rate of an area as it is stretched, over the area: below it is nearly round */

/* The volume that a membrane encloses, normals n [nnode][dim] at its nodes (means of those around them, of length 1; 0
   where it is held) and how much more volume a step along them gives: what nodes have of the surface, since the volume
   changes by the integral of phi_i n . dx_i. n: zeros */
static void find_normals(const SolidMesh *m, const PetscBool held[], const PetscReal x[], PetscReal *volume,
                         PetscReal n[], PetscReal *rate)
{
  const PetscInt dim = m->dim;

  *volume = *rate = 0;
  for (PetscInt i = 0; i < m->ncell * m->nq; i++) {
    const PetscInt  *node = m->cell_node + i / m->nq * m->nb;
    const PetscReal *phi = m->phi + i % m->nq * m->nb, w = m->weight[i];
    PetscReal        xc[SOLID_MAX_N], F[9], at[3], normal[3];

    SolidGather(m, i / m->nq, x, xc);
    (void)SolidGradient(m, i / m->nq, i % m->nq, xc, F);
    MembraneNormal(dim, F, normal);
    SolidLocate(m, i % m->nq, xc, at);
    *volume += w * dot3(at, normal) / (PetscReal)dim;
    for (PetscInt j = 0; j < m->nb * dim; j++) n[dim * node[j / dim] + j % dim] += w * phi[j / dim] * normal[j % dim];
  }
  for (PetscInt i = 0; i < m->nnode; i++) {
    PetscReal norm = 0;

    for (PetscInt a = 0; a < dim; a++) norm += PetscSqr(n[dim * i + a]);
    norm = PetscSqrtReal(norm);
    for (PetscInt a = 0; a < dim && norm > 0; a++) n[dim * i + a] *= held[i] ? 0 : 1 / norm;
    *rate += held[i] ? 0 : norm;
  }
}

/* All of a solid as much larger or smaller */
static void scale(const SolidMesh *m, PetscReal x[], PetscReal *error)
{
  PetscReal       centroid[3];
  const PetscReal volume = SolidFindVolume(m, x, centroid),
                  factor = PetscPowReal(m->volume / volume, 1 / (PetscReal)m->dim);

  *error = volume / m->volume - 1;
  for (PetscInt i = 0; i < m->nnode * m->dim; i++) x[i] = centroid[i % m->dim] + factor * (x[i] - centroid[i % m->dim]);
}

/* What a membrane is longer along some axes than along others, D (x - centre) at its nodes, D without trace: to first
   order its volume stays. w [nnode][dim], zero where it is held */
static void find_stretch(const SolidMesh *m, const PetscBool held[], const PetscReal x[], PetscReal w[])
{
  const PetscInt dim       = m->dim;
  PetscReal      centre[3] = {0}, D[9] = {0}, mean = 0, norm = 0;

  for (PetscInt i = 0; i < dim * m->nnode; i++) centre[i % dim] += x[i] / (PetscReal)m->nnode;
  for (PetscInt i = 0; i < m->nnode; i++)
    for (PetscInt e = 0; e < dim * dim; e++)
      D[e] += (x[dim * i + e / dim] - centre[e / dim]) * (x[dim * i + e % dim] - centre[e % dim]);
  for (PetscInt a = 0; a < dim; a++) mean += D[a * (dim + 1)] / (PetscReal)dim;
  for (PetscInt a = 0; a < dim; a++) D[a * (dim + 1)] -= mean;
  for (PetscInt e = 0; e < dim * dim; e++) norm += D[e] * D[e];
  norm = norm > 0 ? PetscSqrtReal(norm) : 1;
  for (PetscInt i = 0; i < dim * m->nnode; i++) {
    w[i] = 0;
    for (PetscInt b = 0; b < dim && !held[i / dim]; b++)
      w[i] += D[i % dim * dim + b] / norm * (x[i / dim * dim + b] - centre[b]);
  }
}

/* How far nodes are to be stretched on top of a step `along` the normals n for that area; 0: it cannot be had so.
   work [2][nnode][dim], in it first the direction */
static PetscReal stretch_for(const SolidMesh *m, const PetscBool held[], PetscReal area, const PetscReal x[],
                             const PetscReal n[], PetscReal along, PetscReal work[])
{
  PetscReal *w = work, *l = work + m->dim * m->nnode, lack = area - SolidFindArea(m, x, l), rate = 0;

  find_stretch(m, held, x, w);
  for (PetscInt i = 0; i < m->dim * m->nnode; i++) {
    lack -= along * l[i] * n[i];
    rate += l[i] * w[i];
  }
  return rate > ROUND * area ? lack / rate : 0;
}

/* Nodes x of a membrane moved for its volume, and for that area (0: any); work [3][nnode][dim]. Are both met? An area
   that is less than any shape of the volume has is not. */
static PetscBool move_nodes(const SolidMesh *m, const PetscBool held[], PetscReal area, PetscReal x[], PetscReal work[],
                            PetscReal *error)
{
  const PetscInt all = m->dim * m->nnode;
  PetscReal     *n = work + 2 * all, volume, rate, total = 0;

  for (PetscInt it = 0; it < VOLUME_IT; it++) {
    PetscReal along, stretch;

    for (PetscInt i = 0; i < all; i++) n[i] = 0;
    find_normals(m, held, x, &volume, n, &rate);
    if (!it) *error = volume / m->volume - 1;
    along   = (m->volume - volume) / rate;
    stretch = area > 0 ? stretch_for(m, held, area, x, n, along, work) : 0;
    if (PetscAbsReal(volume - m->volume) <= VOLUME_TOL * m->volume && PetscAbsReal(stretch) <= VOLUME_TOL)
      return PETSC_TRUE;
    total += PetscAbsReal(stretch);
    if (!(total < FARTHEST)) return PETSC_FALSE;
    for (PetscInt i = 0; i < all; i++) x[i] += along * n[i] + stretch * work[i];
  }
  return PETSC_FALSE;
}

PetscErrorCode SolidKeepVolume(const SolidMesh *m, const PetscBool held[], PetscReal area, PetscReal x[],
                               PetscReal *error)
{
  const PetscInt all = m->dim * m->nnode;
  PetscReal     *before, *work;

  PetscFunctionBeginUser;
  *error = 0;
  if (!SolidIsMembrane(m)) {
    scale(m, x, error);
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(PetscCalloc2(all, &before, 3 * all, &work));
  PetscCall(PetscArraycpy(before, x, all));
  if (!move_nodes(m, held, area, x, work, error) && area > 0) {
    PetscCall(PetscArraycpy(x, before, all));
    (void)move_nodes(m, held, 0, x, work, error);
  }
  PetscCall(PetscFree2(before, work));
  PetscFunctionReturn(PETSC_SUCCESS);
}
