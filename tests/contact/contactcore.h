/* Helpers of the tests of contact: bodies from options, forces, comparisons that print. */
#pragma once
#include "compat.h"
#include "impl.h"
#include "base/opt.h"
#include "raised.h"
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#define OK(call) assert_int_equal(call, 0)

static const PetscReal zero[3] = {0, 0, 0}, one[3] = {1, 1, 1}, down[3] = {0, -10, 0};

typedef struct {
  Bodies      b;
  BodyArrays *s;
  Contact     c;
  PetscReal (*force)[3], (*torque)[3], (*a)[3], (*alpha)[3], *gap;
} Fixture;

static inline void allocate(Fixture *f)
{
  f->force  = calloc(f->s->n + 1, sizeof(*f->force));
  f->torque = calloc(f->s->n + 1, sizeof(*f->torque));
  f->a      = calloc(f->s->n + 1, sizeof(*f->a));
  f->alpha  = calloc(f->s->n + 1, sizeof(*f->alpha));
  f->gap    = calloc(f->s->n + 1, sizeof(*f->gap));
}

static inline void create(Fixture *f, PetscInt dim, PetscReal h, const PetscReal gravity[3], const PetscReal lower[3],
                          const PetscReal upper[3], PetscInt walls, const char options[])
{
  OK(PetscOptionsClear(NULL));
  OK(PetscOptionsInsertString(NULL, options));
  OK(BodiesCreate(dim, lower, upper, &f->b));
  OK(BodiesGetArrays(f->b, &f->s));
  OK(ContactCreate(f->b, h, 1, gravity, lower, upper, walls, &f->c));
  allocate(f);
}
static inline void destroy(Fixture *f)
{
  OK(ContactDestroy(&f->c));
  OK(BodiesDestroy(&f->b));
  free(f->force);
  free(f->torque);
  free(f->a);
  free(f->alpha);
  free(f->gap);
}

/* Gaps and forces of the law alone, without damping and friction, for the bodies where they are */
static inline void evaluate(Fixture *f)
{
  Contact c = f->c;

  ContactSetScales(c, 0, NULL);
  for (PetscInt k = 0; k < f->s->n; k++) {
    f->gap[k] = PETSC_MAX_REAL;
    for (PetscInt a = 0; a < 3; a++) f->force[k][a] = f->torque[k][a] = 0;
  }
  OK(ContactUseCopies(c, f->s->x, f->s->q, f->s->u, f->s->w));
  OK(PetscFree(c->list.reach));
  OK(ContactFindPairs(c));
  for (PetscInt k = 0; k < f->s->n && c->dim == 3; k++) OK(ContactSetInertia(c, k));
  c->count.near = c->list.n;
  for (PetscInt p = 0; p < c->list.n; p++) {
    Impulse   now = {{0}, {0}, {0}};
    PetscInt  n;
    PetscReal gap;
    Rub       rub;

    OK(ContactPairDashpots(c, p, 0, &n, &rub, &gap));
    for (PetscInt d = 0; d < n; d++)
      ContactAddForce(&c->dashpot[d],
                      ContactDashpotForce(c, &c->dashpot[d], ContactApproach(c, &c->list.pair[p], &c->dashpot[d]), 0),
                      &now);
    ContactNoteGap(&c->list.pair[p], gap, f->gap);
    ContactScatter(&c->list.pair[p], &now, 1, f->force, f->torque);
  }
}

static inline PetscReal smallest(const Fixture *f, const PetscReal gap[])
{
  PetscReal least = PETSC_MAX_REAL;

  for (PetscInt k = 0; k < f->s->n; k++) least = PetscMin(least, gap[k]);
  return least;
}

static inline void near(PetscReal got, PetscReal want, PetscReal tolerance)
{
  if (!(PetscAbsReal(got - want) <= tolerance))
    fail_msg("%.17g differs from %.17g by more than %g", (double)got, (double)want, (double)tolerance);
}
