/* Leave: see leave.h. A removed body keeps its last place in the state, at rest, and is marked as gone. */
#include "compat.h"
#include "bodies/leave.h"
#include "bodies/local.h"
#include "impl.h"
#include "base/domain.h"
#include "base/opt.h"

struct _p_Leave {
  Bodies      bodies;
  BodyArrays *s;
  PetscReal   lower[3], upper[3], period[3];
  PetscInt    remove; /* bit 2 axis for the lower face, 2 axis + 1 for the upper */
};

static PetscErrorCode read_faces(Leave b)
{
  char    *list[7];
  PetscInt n = 7;

  PetscFunctionBeginUser;
  PetscCall(OptStringArray("-particle_remove", &n, list));
  for (PetscInt i = 0; i < n; i++) {
    PetscInt f = 0;

    while (f < 2 * b->s->dim && strcmp(list[i], DOMAIN_SIDE[f])) f++;
    PetscCheck(f < 2 * b->s->dim, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
               "-particle_remove: boundary '%s' is not known (known: left, right, bottom, top%s)", list[i], b->s->dim == 3 ? ", back, front" : "");
    PetscCheck(b->period[f / 2] == 0, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
               "-particle_remove %s has no meaning: the domain is periodic there and bodies come in again. Remove it", list[i]);
    b->remove |= 1 << f;
    PetscCall(PetscFree(list[i]));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode LeaveCreate(Bodies bodies, const PetscReal lower[3], const PetscReal upper[3], const PetscReal period[3], Leave *border)
{
  Leave b;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&b));
  b->bodies = bodies;
  b->s      = &bodies->state;
  for (PetscInt a = 0; a < b->s->dim; a++) {
    b->lower[a]  = lower[a];
    b->upper[a]  = upper[a];
    b->period[a] = period[a];
  }
  if (b->s->nall) PetscCall(read_faces(b));
  *border = b;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode LeaveDestroy(Leave *border)
{
  PetscFunctionBeginUser;
  PetscCall(PetscFree(*border));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Body k has passed face f, which is not periodic */
static PetscErrorCode leave(Leave b, PetscInt k, PetscInt f)
{
  const BodyGroup *g = BodiesGetGroup(&b->bodies->view, k);

  PetscFunctionBeginUser;
  if (!b->s->own[k] && !(b->remove >> f & 1)) PetscFunctionReturn(PETSC_SUCCESS); /* its owner says so */
  PetscCheck(b->remove >> f & 1, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "Body %" PetscInt_FMT
             " of group '%s' has left the domain through boundary '%s': its %c is %g, the domain goes from %g to %g: lower -sim_dt if contact should have kept "
             "it in, or let it go with -particle_remove %s",
             BodiesPlaceInGroup(&b->bodies->view, k), g->name, DOMAIN_SIDE[f], 'x' + (int)f / 2, (double)b->s->x[k][f / 2], (double)b->lower[f / 2],
             (double)b->upper[f / 2], DOMAIN_SIDE[f]);
  b->s->gone[k] = PETSC_TRUE;
  b->s->gap[k]  = PETSC_MAX_REAL;
  for (PetscInt a = 0; a < 3; a++) {
    b->s->u[k][a] = b->s->w[k][a] = b->s->u_old[k][a] = b->s->w_old[k][a] = 0;
    b->s->contact_force[k][a] = b->s->contact_torque[k][a] = 0;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode LeaveApply(Leave b)
{
  BodyArrays *s = b->s;

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < s->n; k++) {
    const BodyGroup *g = BodiesGetGroup(&b->bodies->view, k);

    if (!(g->free & (BODY_FREE_X | BODY_FREE_Y | BODY_FREE_Z))) continue;
    for (PetscInt a = 0; a < s->dim && !s->gone[k]; a++) {
      const PetscReal x = s->x[k][a];

      if (x >= b->lower[a] && x <= b->upper[a]) continue;
      if (b->period[a] > 0) s->x[k][a] = DomainWrap(b->period[a], x, b->lower[a]);
      else PetscCall(leave(b, k, 2 * a + (x > b->upper[a])));
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode LeaveGetRemoved(Leave b, PetscInt *n)
{
  const MPI_Comm comm = BodiesComm(b->bodies);
  PetscMPIInt    size;

  PetscFunctionBeginUser;
  *n = 0;
  for (PetscInt k = 0; k < b->s->n; k++) *n += b->s->gone[k] && b->s->own[k] ? 1 : 0;
  PetscCallMPI(MPI_Comm_size(comm, &size));
  if (size > 1) PetscCallMPI(MPI_Allreduce(MPI_IN_PLACE, n, 1, MPIU_INT, MPI_SUM, comm));
  PetscFunctionReturn(PETSC_SUCCESS);
}
