/* Sums over a solid: see solid/element.h. */
#include "compat.h"
#include "solid/element.h"
#include "membrane.h"
#include "space.h"

static const PetscInt ROW[6] = {0, 1, 2, 0, 0, 1}, COLUMN[6] = {0, 1, 2, 1, 2, 2}; /* of a symmetric tensor */

/* Second moments from those about the origin, the volume and the centroid */
static void shift_moments(PetscInt dim, SolidSums *s)
{
  for (PetscInt a = 0; a < dim; a++) s->centroid[a] /= s->volume;
  for (PetscInt e = 0; e < 6; e++) s->second[e] -= s->volume * (s->centroid[ROW[e]] * s->centroid[COLUMN[e]]);
}

/* Quadrature point q of a cell with nodes xc: F, J, where it is, and what it counts of integrals of 1, x, x x over the
   volume: of a membrane, around which div (x f) is (dim + degree) f, through its surface */
static PetscReal find_point(const SolidMesh *m, PetscInt c, PetscInt q, const PetscReal xc[], PetscReal F[9],
                            PetscReal x[3], PetscReal dV[3])
{
  const PetscReal J = SolidGradient(m, c, q, xc, F);
  PetscReal       normal[3];

  SolidLocate(m, q, xc, x);
  if (SolidIsMembrane(m)) MembraneNormal(m->dim, F, normal);
  for (PetscInt degree = 0; degree < 3; degree++)
    dV[degree] = SolidIsMembrane(m) ? dot3(x, normal) / (PetscReal)(m->dim + degree) : J;
  return J;
}

void SolidMeasure(const SolidMesh *m, const SolidMaterial *material, const PetscReal x[], SolidSums *s)
{
  const PetscInt dim     = m->dim;
  PetscReal      mean[9] = {0};

  *s = (SolidSums){0};
  for (PetscInt c = 0; c < m->ncell; c++) {
    PetscReal xc[SOLID_MAX_N];

    SolidGather(m, c, x, xc);
    for (PetscInt q = 0; q < m->nq; q++) {
      const PetscReal w = m->weight[c * m->nq + q];
      PetscReal       F[9], at[3], dV[3];
      const PetscReal J = find_point(m, c, q, xc, F, at, dV);

      s->volume += w * dV[0];
      for (PetscInt a = 0; a < dim; a++) s->centroid[a] += w * dV[1] * at[a];
      for (PetscInt e = 0; e < 6; e++) s->second[e] += w * dV[2] * at[ROW[e]] * at[COLUMN[e]];
      for (PetscInt e = 0; e < dim * m->nd; e++) mean[e] += w * F[e];
      s->area += SolidIsMembrane(m) ? w * J : 0;
      s->strain_energy += w * SolidLawEnergy(dim, material, F);
      s->stretch_max = PetscMax(s->stretch_max, SolidLargestStretch(dim, m->nd, F));
    }
  }
  s->strain_energy += m->nd < dim ? 0.5 * material->global * PetscSqr(s->area - m->area) / m->area : 0;
  if (material->bending > 0) s->strain_energy += SolidBend(m, material->bending, x, NULL);
  shift_moments(dim, s);
  if (m->nd == 2 && dim == 2) s->rotation = PetscAtan2Real(mean[dim] - mean[1], mean[0] + mean[dim + 1]);
}

PetscReal SolidFindVolume(const SolidMesh *m, const PetscReal x[], PetscReal centroid[3])
{
  PetscReal volume = 0;

  for (PetscInt a = 0; a < 3; a++) centroid[a] = 0;
  for (PetscInt c = 0; c < m->ncell; c++) {
    PetscReal xc[SOLID_MAX_N];

    SolidGather(m, c, x, xc);
    for (PetscInt q = 0; q < m->nq; q++) {
      const PetscReal w = m->weight[c * m->nq + q];
      PetscReal       F[9], at[3], dV[3];

      (void)find_point(m, c, q, xc, F, at, dV);
      volume += w * dV[0];
      for (PetscInt a = 0; a < m->dim; a++) centroid[a] += w * dV[1] * at[a];
    }
  }
  for (PetscInt a = 0; a < 3; a++) centroid[a] /= volume;
  return volume;
}

void SolidMeanVelocity(const SolidMesh *m, const PetscReal x[], const PetscReal u[], PetscReal mean[3])
{
  PetscReal volume = 0;

  for (PetscInt a = 0; a < 3; a++) mean[a] = 0;
  for (PetscInt c = 0; c < m->ncell; c++) {
    PetscReal xc[SOLID_MAX_N], uc[SOLID_MAX_N];

    SolidGather(m, c, x, xc);
    SolidGather(m, c, u, uc);
    for (PetscInt q = 0; q < m->nq; q++) {
      PetscReal F[9], at[3], v[3], normal[3], w = m->weight[c * m->nq + q];

      SolidLocate(m, q, uc, v);
      if (SolidIsMembrane(m)) { /* int u_a dV is that of x_a u . n over the surface */
        (void)SolidGradient(m, c, q, xc, F);
        MembraneNormal(m->dim, F, normal);
        SolidLocate(m, q, xc, at);
        volume += w * dot3(at, normal) / (PetscReal)m->dim;
        for (PetscInt a = 0; a < m->dim; a++) mean[a] += w * at[a] * dot3(v, normal);
      } else {
        volume += w;
        for (PetscInt a = 0; a < m->dim; a++) mean[a] += w * v[a];
      }
    }
  }
  for (PetscInt a = 0; a < m->dim; a++) mean[a] /= volume;
}
