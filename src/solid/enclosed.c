/* What a membrane encloses, and the volume of a solid, is kept: see solid/element.h. */
#include "compat.h"
#include "solid/element.h"
#include "membrane.h"

#define VOLUME_IT  10
#define VOLUME_TOL 1e-13

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

/* The volume of a solid and its centroid */
static PetscReal find_volume(const SolidMesh *m, const PetscReal x[], PetscReal centroid[3])
{
  PetscReal volume = 0;

  for (PetscInt a = 0; a < 3; a++) centroid[a] = 0;
  for (PetscInt i = 0; i < m->ncell * m->nq; i++) {
    PetscReal xc[SOLID_MAX_N], F[9], at[3], w;

    SolidGather(m, i / m->nq, x, xc);
    w = m->weight[i] * SolidGradient(m, i / m->nq, i % m->nq, xc, F);
    SolidLocate(m, i % m->nq, xc, at);
    volume += w;
    for (PetscInt a = 0; a < 3; a++) centroid[a] += w * at[a];
  }
  for (PetscInt a = 0; a < 3; a++) centroid[a] /= volume;
  return volume;
}

/* All of a solid as much larger or smaller */
static void scale(const SolidMesh *m, PetscReal x[], PetscReal *error)
{
  PetscReal       centroid[3];
  const PetscReal volume = find_volume(m, x, centroid),
                  factor = PetscPowReal(m->volume / volume, 1 / (PetscReal)m->dim);

  *error = volume / m->volume - 1;
  for (PetscInt i = 0; i < m->nnode * m->dim; i++) x[i] = centroid[i % m->dim] + factor * (x[i] - centroid[i % m->dim]);
}

PetscErrorCode SolidKeepVolume(const SolidMesh *m, const PetscBool held[], PetscReal x[], PetscReal *error)
{
  PetscReal *n, volume, rate;

  PetscFunctionBeginUser;
  *error = 0;
  if (!SolidIsMembrane(m)) {
    scale(m, x, error);
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(PetscMalloc1(m->dim * m->nnode, &n));
  for (PetscInt it = 0; it < VOLUME_IT; it++) {
    PetscCall(PetscArrayzero(n, m->dim * m->nnode));
    find_normals(m, held, x, &volume, n, &rate);
    if (!it) *error = volume / m->volume - 1;
    if (PetscAbsReal(volume - m->volume) <= VOLUME_TOL * m->volume) break;
    for (PetscInt i = 0; i < m->dim * m->nnode; i++) x[i] += (m->volume - volume) / rate * n[i];
  }
  PetscCall(PetscFree(n));
  PetscFunctionReturn(PETSC_SUCCESS);
}
