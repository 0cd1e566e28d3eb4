/* Elastic, power: energy of elastic solids, what acts on them from outside, and where their energy goes (elastic.h). */
#include "compat.h"
#include "elastic.h"
#include "elasticgap.h"
#include "impl.h"
#include "bodies/local.h"

PetscReal ElasticMotion(const SolidMesh *m, const PetscReal u[], PetscReal sum[3])
{
  PetscReal half = 0;

  for (PetscInt a = 0; a < 3; a++) sum[a] = 0;
  for (PetscInt cell = 0; cell < m->ncell && !SolidIsMembrane(m); cell++) {
    PetscReal uc[SOLID_MAX_N], v[3];

    SolidGather(m, cell, u, uc);
    for (PetscInt q = 0; q < m->nq; q++) {
      const PetscReal w = m->weight[cell * m->nq + q];

      SolidLocate(m, q, uc, v);
      for (PetscInt a = 0; a < m->dim; a++) {
        half += 0.5 * w * v[a] * v[a];
        sum[a] += w * v[a];
      }
    }
  }
  return half;
}

/* *power += that of the weight of solid k in excess of the fluid's, with int u_s */
static void add_weight(const Elastic *e, Couple c, PetscInt k, const PetscReal sum[3], PetscReal *power)
{
  for (PetscInt a = 0; a < e->s->dim; a++) *power += ElasticExcess(e, c, k) * c->par->gravity[a] * sum[a];
}

/* motion [n][4] of all solids: what ElasticMotion has of them at the end of the step solved */
static PetscErrorCode find_motion(const Elastic *e, PetscReal motion[])
{
  const SolidsState *s = e->s;

  PetscFunctionBeginUser;
  for (PetscInt k = s->own[0]; k < s->own[1]; k++)
    motion[4 * k] = ElasticMotion(&s->group[s->group_of[k]].mesh, e->u + s->dim * s->first[k], motion + 4 * k + 1);
  PetscCall(SolidsExchange(s, 4, motion));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ElasticAddEnergy(const Elastic *e, Couple c, CouplePower *w)
{
  const SolidsState *s      = e->s;
  PetscReal          weight = 0, *motion, *strain;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc2(4 * s->n, &motion, s->n, &strain));
  PetscCall(find_motion(e, motion));
  for (PetscInt k = s->own[0]; k < s->own[1]; k++) {
    const SolidGroup *g = s->group + s->group_of[k];
    SolidSums         sums;

    SolidMeasure(&g->mesh, &g->material, e->end + s->dim * s->first[k], &sums);
    strain[k] = sums.strain_energy;
  }
  PetscCall(SolidsExchange(s, 1, strain));
  for (PetscInt k = 0; k < s->n; k++) {
    const PetscReal density = s->group[s->group_of[k]].density, inner = ElasticIsLined(e, k) ? 0 : c->par->density;

    w->energy += (density - inner) * motion[4 * k] + strain[k];
    w->size += density * motion[4 * k] + strain[k];
    add_weight(e, c, k, motion + 4 * k + 1, &weight);
  }
  w->power += weight + e->supplied;
  PetscCall(PetscFree2(motion, strain));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ElasticAddPull(const Elastic *e, PetscReal *size)
{
  const SolidsState *s = e->s;
  PetscReal         *pull;

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc1(s->n, &pull));
  for (PetscInt k = s->own[0]; k < s->own[1]; k++) {
    const SolidMesh *m = &s->group[s->group_of[k]].mesh;
    SolidSums        sums;

    if (!SolidIsMembrane(m)) continue;
    SolidsMeasure(e->solids, k, &sums);
    pull[k] = sums.strain_energy / m->radius;
  }
  PetscCall(SolidsExchange(s, 1, pull));
  for (PetscInt k = 0; k < s->n; k++) *size += pull[k];
  PetscCall(PetscFree(pull));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Of the cells of solids that this rank has: what their own viscosity takes */
static PetscReal viscous_power(const Elastic *e)
{
  const SolidsState *s     = e->s;
  PetscReal          power = 0;

  for (PetscInt k = 0; k < s->n; k++) {
    const SolidGroup *g = s->group + s->group_of[k];
    const SolidMesh  *m = &g->mesh;
    const PetscInt    n = m->nb * m->dim;

    for (PetscInt cell = 0; cell < m->ncell && g->viscosity != 0; cell++) {
      const PetscInt first = s->first[k] + m->cell_node[cell * m->nb];
      PetscReal      x[SOLID_MAX_N], u[SOLID_MAX_N], V[SOLID_MAX_N * SOLID_MAX_N];

      if (first < e->nodes[0] || first >= e->nodes[1]) continue;
      SolidGather(m, cell, e->x + m->dim * s->first[k], x);
      SolidGather(m, cell, e->u + m->dim * s->first[k], u);
      SolidCellViscosity(m, cell, x, V);
      for (PetscInt i = 0; i < n * n; i++) power += g->viscosity * u[i / n] * V[i] * u[i % n];
    }
  }
  return power;
}

/* p . (C p - g): what the pressure does on the volumes of solids, by this rank's cells */
static PetscReal volume_power(const Elastic *e, const PetscReal p[])
{
  const PetscInt nk    = e->s->dim + 1;
  PetscReal      power = 0;

  for (PetscInt i = 0; i < e->volumes.n; i++) {
    const PetscReal *own = p + nk * e->volumes.cell[i], *C = e->volumes.C + i * nk * nk, *g = e->volumes.g + i * nk;

    for (PetscInt j = 0; j < nk; j++) {
      power -= own[j] * g[j];
      for (PetscInt b = 0; b < nk; b++) power += own[j] * C[j * nk + b] * own[b];
    }
  }
  return power;
}

/* us . (K us - fs): inertia, stress, viscosity, less contact and weight; the same on all ranks */
static PetscErrorCode total_power(const Elastic *e, PetscReal *power)
{
  Vec       force;
  PetscReal given;

  PetscFunctionBeginUser;
  PetscCall(VecDuplicate(e->us, &force));
  PetscCall(MatMult(e->K, e->us, force));
  PetscCall(VecDot(force, e->us, power));
  PetscCall(VecDot(e->fs, e->us, &given));
  PetscCall(VecDestroy(&force));
  *power -= given;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* *power += what contact does on rigid bodies that this rank owns */
static PetscErrorCode push_power(const Elastic *e, Couple c, PetscReal *power)
{
  PetscReal *push;

  PetscFunctionBeginUser;
  if (!c->s->nall) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscCalloc1(c->s->n * c->nr, &push));
  PetscCall(ElasticPushBodies(e, c, push));
  for (PetscInt i = 0; i < c->s->n * c->nr; i++)
    if (c->s->own[i / c->nr]) *power += push[i] * c->rigid.U[i];
  PetscCall(PetscFree(push));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ElasticAddLosses(const Elastic *e, Couple c, CoupleLosses *w)
{
  PetscReal total, flux[3], *motion, inertia = 0, force = 0, weight = 0;
  PetscReal sum[6] = {viscous_power(e), ElasticContactPower(e), 0, volume_power(e, c->field.p)};

  PetscFunctionBeginUser;
  PetscCall(total_power(e, &total));
  PetscCall(push_power(e, c, &sum[2]));
  PetscCall(PetscMalloc1(4 * e->s->n, &motion));
  PetscCall(find_motion(e, motion));
  for (PetscInt k = 0; k < e->s->n; k++) add_weight(e, c, k, motion + 4 * k + 1, &weight);
  PetscCall(PetscFree(motion));
  if (e->align) {
    PetscCall(ElasticInertiaPower(&e->inertia, c->mesh, c->loc, c->field.u, &inertia, &force, flux));
    for (PetscInt a = 0; a < e->s->dim; a++) force -= c->par->density * c->par->gravity[a] * flux[a];
  }
  sum[3] += inertia;
  sum[4] = force; /* with the weight of the fluid that the pressure has there */
  if (e->viscosity) PetscCall(CoupleViscousPower(c, e->viscosity, c->field.u, &sum[5]));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 6, MPIU_REAL, MPIU_SUM, c->comm));
  if (e->viscosity) w->viscous = sum[5];
  w->viscous += sum[0];
  w->boundary -= sum[1] + sum[2] + sum[3];
  w->inertia += total - sum[0] + sum[1] + sum[3] - sum[4] + weight;
  PetscFunctionReturn(PETSC_SUCCESS);
}
