/* Elastic, limits of a step: no node of a solid goes further than a cell of the flow, so that none leaps over the cell
   in which contact keeps it away (but where the mesh goes along with solids that are held), and no cell of a solid is
   strained by more than a half, so that its nodes as they are predicted do not cross. Waves of the material are
   implicit and limit nothing. */
#include "compat.h"
#include "elastic.h"
#include "impl.h"
#include "base/algebra.h"

#define WAY      1.0
#define STRAIN   0.5
#define INVERTED 10   /* so much too long is a step that turns a cell inside out */
#define HOPELESS 1e-4 /* of the step that was asked for */
#define LOST     0.1  /* of a volume in a step */

/* Largest |grad u| (Frobenius) of solid k with velocities u [mesh.nnode][dim], at quadrature points: G (F^T F)^-1 G^T
   has its square as the trace, of a membrane that of the gradient along it */
static PetscReal find_rate(const Elastic *e, PetscInt k, const PetscReal u[])
{
  const SolidMesh *m   = &e->s->group[e->s->group_of[k]].mesh;
  const PetscInt   dim = m->dim, nd = m->nd;
  PetscReal        most = 0;

  for (PetscInt cell = 0; cell < m->ncell; cell++) {
    PetscReal xc[SOLID_MAX_N], uc[SOLID_MAX_N];

    SolidGather(m, cell, e->s->x + dim * e->s->first[k], xc);
    SolidGather(m, cell, u, uc);
    for (PetscInt q = 0; q < m->nq; q++) {
      PetscReal F[9], C[9] = {0}, inverse[9], G[9], square = 0;

      (void)SolidGradient(m, cell, q, xc, F);
      (void)SolidGradient(m, cell, q, uc, G);
      for (PetscInt j = 0; j < nd * nd; j++)
        for (PetscInt a = 0; a < dim; a++) C[j] += F[a * nd + j / nd] * F[a * nd + j % nd];
      if (nd == 1) inverse[0] = 1 / C[0];
      else (void)DenseInvertMap(nd, C, inverse);
      for (PetscInt j = 0; j < nd * nd; j++)
        for (PetscInt a = 0; a < dim; a++) square += G[a * nd + j / nd] * inverse[j] * G[a * nd + j % nd];
      most = PetscMax(most, square);
    }
  }
  return PetscSqrtReal(most);
}

/* The longest step that velocities u [nnode][dim] let the solids stand. Collective. */
static PetscErrorCode find_longest(const Elastic *e, Couple c, const PetscReal u[], PetscReal *dt)
{
  const SolidsState *s       = e->s;
  PetscReal          longest = PETSC_MAX_REAL, rate;

  PetscFunctionBeginUser;
  for (PetscInt i = s->first[s->own[0]]; i < s->first[s->own[1]] && !e->ale; i++) {
    PetscReal square = 0;

    for (PetscInt a = 0; a < s->dim; a++) square += PetscSqr(u[s->dim * i + a]);
    if (square > 0) longest = PetscMin(longest, WAY * c->loc->h / PetscSqrtReal(square));
  }
  for (PetscInt k = s->own[0]; k < s->own[1]; k++)
    if ((rate = find_rate(e, k, u + s->dim * s->first[k])) > 0) longest = PetscMin(longest, STRAIN / rate);
  PetscCall(MPIU_Allreduce(&longest, dt, 1, MPIU_REAL, MPIU_MIN, s->comm));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Has solid k a cell with J <= 0 at the positions at the end of the step? */
static PetscBool is_inverted(const Elastic *e, PetscInt k)
{
  const SolidMesh *m = &e->s->group[e->s->group_of[k]].mesh;

  for (PetscInt cell = 0; cell < m->ncell; cell++) {
    PetscReal xc[SOLID_MAX_N], F[9];

    SolidGather(m, cell, e->end + m->dim * e->s->first[k], xc);
    for (PetscInt q = 0; q < m->nq; q++)
      if (!(SolidGradient(m, cell, q, xc, F) > 0)) return PETSC_TRUE;
  }
  return PETSC_FALSE;
}

/* The last of these solids, -1: none. Collective. */
static PetscErrorCode find_inverted(const Elastic *e, PetscInt *inverted)
{
  PetscInt last = -1;

  PetscFunctionBeginUser;
  for (PetscInt k = e->s->own[0]; k < e->s->own[1]; k++)
    if (is_inverted(e, k)) last = k;
  PetscCall(MPIU_Allreduce(&last, inverted, 1, MPIU_INT, MPI_MAX, e->s->comm));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ElasticCheckStep(const Elastic *e, Couple c)
{
  PetscInt inverted;

  PetscFunctionBeginUser;
  PetscCall(find_inverted(e, &inverted));
  PetscCheck(inverted < 0, c->comm, PETSC_ERR_USER_INPUT,
             "A cell of an elastic particle of group '%s' turns inside out in the step to t = %g: the step does not follow it, or what is around it is not "
             "resolved; use a shorter step (-sim_dt %g), smaller cells (-mesh_cells) or a stiffer particle",
             e->s->group[e->s->group_of[inverted]].name, (double)c->step->time, (double)(0.5 * c->step->dt));
  for (PetscInt k = 0; k < e->s->n; k++)
    PetscCheck(PetscAbsReal(e->kept[k]) < LOST, c->comm, PETSC_ERR_USER_INPUT,
               "An elastic particle of group '%s' changes its volume by %.2g in the step to t = %g: the step does not follow it, or what is around it is "
               "not resolved; use a shorter step (-sim_dt %g) or smaller cells",
               e->s->group[e->s->group_of[k]].name, (double)e->kept[k], (double)c->step->time,
               (double)(0.5 * c->step->dt));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ElasticLimitStep(const Elastic *e, Couple c, PetscReal *dt)
{
  const SolidsState *s     = e->s;
  const PetscInt     n     = s->nnode * s->dim;
  const PetscReal    more  = s->time_dt > 0 ? PetscMin(1, *dt / s->time_dt) : 0; /* of the last change once more */
  const PetscReal    asked = *dt;
  PetscReal         *u, longest[2];

  PetscFunctionBeginUser;
  PetscCall(find_longest(e, c, s->u, &longest[0]));
  PetscCall(PetscMalloc1(n, &u));
  for (PetscInt i = 0; i < n; i++) u[i] = s->u[i] + more * (s->u[i] - s->u_old[i]);
  PetscCall(find_longest(e, c, u, &longest[1]));
  *dt = PetscMin(*dt, PetscMin(longest[0], longest[1]));
  PetscCall(PetscFree(u));
  PetscCheck(asked == PETSC_MAX_REAL || *dt > HOPELESS * asked, c->comm, PETSC_ERR_USER_INPUT,
             "Elastic particles move so fast, or are strained so fast, after t = %g that a step would be %.2g, for %.2g that was asked: what is around them "
             "is not resolved, or they are too soft for what acts on them. Start with a shorter step (-sim_dt), use smaller cells (-mesh_cells) or a stiffer "
             "particle",
             (double)c->step->time, (double)*dt, (double)asked);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ElasticOverstep(const Elastic *e, Couple c, PetscReal *ratio)
{
  PetscReal longest;
  PetscInt  inverted;

  PetscFunctionBeginUser;
  PetscCall(find_longest(e, c, e->u, &longest));
  PetscCall(find_inverted(e, &inverted));
  *ratio = PetscMax(*ratio, c->step->dt / longest);
  if (inverted >= 0) *ratio = PetscMax(*ratio, INVERTED);
  PetscFunctionReturn(PETSC_SUCCESS);
}
