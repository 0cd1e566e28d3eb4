/* Couple, inertia: rigid velocities of the last two steps, and the momentum that bodies bring into the step. */
#include "compat.h"
#include "impl.h"
#include "bodies/mass.h"

void CoupleGetHistory(Couple c, PetscInt k, PetscInt i, PetscReal *now, PetscReal *old)
{
  const PetscBool kept = (PetscBool)(i < c->loc->dim && BodiesGetGroup(c->s, k)->motion.has_pivot);

  *now = kept ? c->rigid.U_old[k * c->nr + i] : RigidValue(c->loc->dim, c->s->u[k], c->s->w[k], i);
  *old = kept ? c->rigid.U_older[k * c->nr + i] : RigidValue(c->loc->dim, c->s->u_old[k], c->s->w_old[k], i);
}

PetscErrorCode CoupleHistory(Couple c, PetscInt k, const PetscReal M[], const PetscReal now[], const PetscReal old[],
                             PetscReal out[])
{
  const PetscInt nr = c->nr, dim = c->loc->dim;
  PetscReal      M0[36], M1[36];

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < nr; i++) {
    out[i] = 0;
    for (PetscInt j = 0; j < nr; j++) out[i] += M[i * nr + j] * (c->step->d0 * now[j] + c->step->d1 * old[j]);
  }
  if (dim == 2) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(RigidGetMass(c->bodies, k, c->s->q[k], M0));
  PetscCall(RigidGetMass(c->bodies, k, c->s->q_old[k], M1));
  for (PetscInt i = dim; i < nr; i++)
    for (PetscInt j = dim; j < nr; j++) {
      const PetscInt e = i * nr + j;

      out[i] += c->step->d0 * (M0[e] - M[e]) * now[j] + c->step->d1 * (M1[e] - M[e]) * old[j];
    }
  PetscFunctionReturn(PETSC_SUCCESS);
}

#define STIFFNESS 1e8 /* stiffness of what holds a hinge or slide, in inertias of body and fluid */

static void constrain_block(PetscInt nr, PetscInt first, PetscInt n, const PetscReal e[3], PetscReal scale,
                            const PetscReal M[], PetscReal K[])
{
  PetscReal largest = 0;

  for (PetscInt i = first; i < first + n; i++) largest = PetscMax(largest, M[i * (nr + 1)]);
  for (PetscInt i = 0; i < n; i++)
    for (PetscInt j = 0; j < n; j++)
      K[(first + i) * nr + first + j] = STIFFNESS * scale * largest * ((i == j) - e[i] * e[j]);
}

PetscBool CoupleConstrainAxes(Couple c, PetscInt k, const PetscReal M[], PetscReal K[])
{
  const Motion   *m     = &BodiesGetGroup(c->s, k)->motion;
  const PetscReal scale = c->step->ct * (c->s->density[k] + c->par->density);

  for (PetscInt i = 0; i < c->nr * c->nr; i++) K[i] = 0;
  if (m->has_slide) constrain_block(c->nr, 0, c->loc->dim, m->slide, scale, M, K);
  if (m->has_hinge) constrain_block(c->nr, c->loc->dim, 3, m->hinge, scale, M, K);
  return (PetscBool)(m->has_slide || m->has_hinge);
}
