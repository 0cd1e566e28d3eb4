/* BodiesOutflow: see outflow.h. A removed body keeps its last position in the state, at rest, and is marked as gone. */
#include "compat.h"
#include "bodies/outflow.h"
#include "bodies/local.h"
#include "impl.h"
#include "base/domain.h"
#include "base/opt.h"

struct _p_BodiesOutflow {
  Bodies      bodies;
  BodyArrays *s;
  Border      border;
  PetscReal   lower[3], upper[3], period[3];
  PetscInt    side[6]; /* boundary of each side of the box, -1: none */
  PetscBool  *remove;  /* [boundaries] */
};

/* name is no boundary */
static PetscErrorCode refuse_name(BodiesOutflow b, const char name[])
{
  char        known[1024] = "";
  PetscInt    n;
  size_t      used = 0;
  const char *other;

  PetscFunctionBeginUser;
  for (PetscInt f = 0; f < 2 * b->s->dim; f++)
    PetscCheck(b->period[f / 2] == 0 || strcmp(name, DOMAIN_SIDE[f]), PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
               "-particle_remove %s has no meaning: the domain is periodic there and bodies come in again. Remove it",
               name);
  PetscCall(BorderGetBoundaries(b->border, &n));
  for (PetscInt i = 0; i < n && used < sizeof(known); i++) {
    PetscCall(BorderGetName(b->border, i, &other));
    used += (size_t)snprintf(known + used, sizeof(known) - used, "%s%s", i ? ", " : "", other);
  }
  SETERRQ(PETSC_COMM_SELF, PETSC_ERR_USER_INPUT, "-particle_remove: boundary '%s' is not known (known: %s)", name,
          known);
}

static PetscErrorCode read_boundaries(BodiesOutflow b)
{
  char    *list[32];
  PetscInt n = 32, boundary;

  PetscFunctionBeginUser;
  PetscCall(OptStringArray("-particle_remove", &n, list));
  for (PetscInt i = 0; i < n; i++) {
    PetscCall(BorderFind(b->border, list[i], &boundary));
    if (boundary < 0) PetscCall(refuse_name(b, list[i]));
    b->remove[boundary] = PETSC_TRUE;
    PetscCall(PetscFree(list[i]));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodiesOutflowCreate(Bodies bodies, const PetscReal lower[3], const PetscReal upper[3],
                                   const PetscReal period[3], Border border, BodiesOutflow *outflow)
{
  BodiesOutflow b;
  PetscInt      n;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&b));
  b->bodies = bodies;
  b->s      = &bodies->state;
  b->border = border;
  for (PetscInt a = 0; a < b->s->dim; a++) {
    b->lower[a]  = lower[a];
    b->upper[a]  = upper[a];
    b->period[a] = period[a];
  }
  PetscCall(BorderGetBoundaries(border, &n));
  PetscCall(PetscCalloc1(n + 1, &b->remove));
  for (PetscInt f = 0; f < 6; f++) PetscCall(BorderFind(border, DOMAIN_SIDE[f], &b->side[f]));
  if (b->s->nall) PetscCall(read_boundaries(b));
  *outflow = b;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodiesOutflowDestroy(BodiesOutflow *outflow)
{
  PetscFunctionBeginUser;
  if (*outflow) PetscCall(PetscFree((*outflow)->remove));
  PetscCall(PetscFree(*outflow));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Body k has passed that boundary (-1: one without a name) */
static PetscErrorCode remove_through(BodiesOutflow b, PetscInt k, PetscInt boundary)
{
  const BodyGroup *g    = BodiesGetGroup(&b->bodies->view, k);
  const PetscReal *x    = b->s->x[k];
  const PetscBool  goes = (PetscBool)(boundary >= 0 && b->remove[boundary]);
  const char      *name = "";

  PetscFunctionBeginUser;
  if (!b->s->own[k] && !goes) PetscFunctionReturn(PETSC_SUCCESS); /* its owner says so */
  if (boundary >= 0) PetscCall(BorderGetName(b->border, boundary, &name));
  PetscCheck(goes, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "Body %" PetscInt_FMT
             " of group '%s' has left the domain through boundary '%s': its centre is %g,%g,%g, the domain goes from %g,%g,%g to %g,%g,%g: lower -sim_dt if "
             "contact should have kept it in, or let it go with -particle_remove %s",
             BodiesIndexInGroup(&b->bodies->view, k), g->name, name, (double)x[0], (double)x[1], (double)x[2],
             (double)b->lower[0], (double)b->lower[1], (double)b->lower[2], (double)b->upper[0], (double)b->upper[1],
             (double)b->upper[2], name);
  PetscCall(BodiesRemove(b->bodies, k));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Where the border is no box: is body k beyond its nearest boundary? A step takes no body farther than its radius. */
static PetscErrorCode remove_at_boundary(BodiesOutflow b, PetscInt k)
{
  PetscInt  boundary;
  PetscReal gap;

  PetscFunctionBeginUser;
  PetscCall(BorderLocate(b->border, b->s->x[k], 2 * BodiesGetRadius(&b->bodies->view, k), &boundary, &gap));
  if (boundary >= 0 && gap < 0) PetscCall(remove_through(b, k, boundary));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Body k has passed side f of the box, which is not periodic */
static PetscErrorCode remove_at_side(BodiesOutflow b, PetscInt k, PetscInt f)
{
  PetscInt  boundary = b->side[f];
  PetscBool faces;
  PetscReal gap;

  PetscFunctionBeginUser;
  PetscCall(BorderHasFaces(b->border, &faces));
  if (faces || boundary < 0) PetscCall(BorderLocate(b->border, b->s->x[k], PETSC_MAX_REAL, &boundary, &gap));
  PetscCall(remove_through(b, k, boundary));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodiesOutflowApply(BodiesOutflow b)
{
  BodyArrays *s = b->s;

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < s->n; k++) {
    const BodyGroup *g = BodiesGetGroup(&b->bodies->view, k);

    if (!(g->free & (BODY_FREE_X | BODY_FREE_Y | BODY_FREE_Z))) continue;
    for (PetscInt a = 0; a < s->dim && !s->removed[k]; a++) {
      const PetscReal x = s->x[k][a];

      if (x >= b->lower[a] && x <= b->upper[a]) continue;
      if (b->period[a] > 0) s->x[k][a] = DomainWrap(b->period[a], x, b->lower[a]);
      else PetscCall(remove_at_side(b, k, 2 * a + (x > b->upper[a])));
    }
    if (!s->removed[k]) PetscCall(remove_at_boundary(b, k));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodiesOutflowGetRemoved(BodiesOutflow b, PetscInt *n)
{
  const MPI_Comm comm = BodiesComm(b->bodies);
  PetscMPIInt    size;

  PetscFunctionBeginUser;
  *n = 0;
  for (PetscInt k = 0; k < b->s->n; k++) *n += b->s->removed[k] && b->s->own[k] ? 1 : 0;
  PetscCallMPI(MPI_Comm_size(comm, &size));
  if (size > 1) PetscCallMPI(MPI_Allreduce(MPI_IN_PLACE, n, 1, MPIU_INT, MPI_SUM, comm));
  PetscFunctionReturn(PETSC_SUCCESS);
}
