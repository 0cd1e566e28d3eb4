/* Accuracy by elements of the next order, on the mesh of the run: see accuracy.h. */
#include "compat.h"
#include "accuracyimpl.h"
#include "subject.h"

/* The error beside the larger one of what the last two sweeps found; with corners, beside what the last one found, and
   of the energy of that (runs/studies/accuracy) */
#define FOUND   1.3
#define CORNERS 0.4
#define GROWS   4.0 /* energy of what was found, since the first sweep: cells too large for their flow */

typedef struct {
  const SimComponents *p;
  Measured             m[1 + STEADY_SWEEPS]; /* of the run, and after each sweep */
  PetscReal            fraction[1 + STEADY_SWEEPS];
  PetscInt             n;
} Sweeps;

static PetscErrorCode look(void *ctx, const FlowFinerResult *r)
{
  Sweeps   *s = (Sweeps *)ctx;
  Measured *m = s->m + ++s->n;

  PetscFunctionBeginUser;
  PetscCall(SubjectMeasure(s->p, m));
  m->energy += r->energy;
  for (PetscInt a = 0; a < 3; a++) m->velocity[a] += r->velocity[a];
  s->fraction[s->n] = r->fraction;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The worst of all bodies */
static PetscErrorCode find_worst(const Sweeps *s, PetscBool corners, PetscReal *error, PetscBool *bound)
{
  Subject subject;

  PetscFunctionBeginUser;
  PetscCall(SubjectChoose(s->p, &s->m[0], &subject));
  for (PetscInt i = 0; i < subject.n; i++) {
    const PetscReal value = SubjectValue(&subject, &s->m[0], i), found = SubjectValue(&subject, &s->m[s->n], i) - value,
                    last = SubjectValue(&subject, &s->m[s->n - 1], i) - value;
    PetscReal e          = FOUND * PetscMax(PetscAbsReal(found), PetscAbsReal(last));

    if (corners) e = PetscAbsReal(found) + CORNERS * s->fraction[s->n];
    if (e <= *error) continue;
    *error = e;
    *bound = (PetscBool)(corners || 2 * FOUND * PetscAbsReal(found - last) > e);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AccuracyByOrder(const SimComponents *p, PetscBool corners, PetscReal *error, PetscBool *bound)
{
  Sweeps   *s;
  PetscBool ok;

  PetscFunctionBeginUser;
  *error = -1;
  *bound = PETSC_FALSE;
  if (!FlowCanBeFiner(p->flow)) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscNew(&s));
  s->p = p;
  PetscCall(SubjectMeasure(p, &s->m[0]));
  PetscCall(SteadyFiner(p->steady, look, s, &ok));
  if (ok && s->fraction[s->n] <= GROWS * s->fraction[1]) PetscCall(find_worst(s, corners, error, bound));
  PetscCall(PetscFree(s));
  PetscFunctionReturn(PETSC_SUCCESS);
}
