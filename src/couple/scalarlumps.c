/* BodyLumps: see scalarlumps.h. */
#include "compat.h"
#include "impl.h"
#include "scalarlumps.h"

#define NUMBERS 3 /* of a body: value at T^n, T^{n-1}, as solved for */

struct _p_BodyLumps {
  PetscInt              n; /* scalars */
  const ScalarMaterial *material;
  PetscReal            *value; /* [nbodies][n][NUMBERS] */
  PetscBool             started;
  ScalarLumps          *lumps; /* [n] */
  struct {
    PetscBool *is, *own;                    /* [nbodies] */
    PetscReal *capacity, *source, *content; /* [nbodies] */
  } * data;                                 /* [n] */
};

PetscErrorCode BodyLumpsCreate(Couple c, PetscInt n, const ScalarMaterial *material, BodyLumps *lumps)
{
  PetscBool any = PETSC_FALSE;
  BodyLumps s;

  PetscFunctionBeginUser;
  *lumps = NULL;
  for (PetscInt e = 0; e < c->s->ngroups * n; e++)
    any = (PetscBool)(any || material[e].condition == SCALAR_BODY_LUMPED);
  if (!any) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscNew(&s));
  s->n        = n;
  s->material = material;
  PetscCall(PetscCalloc2(n, &s->lumps, n, &s->data));
  PetscCall(BodiesAttach(c->bodies, sizeof(PetscReal) * NUMBERS * (size_t)n, (void **)&s->value));
  *lumps = s;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodyLumpsDestroy(Couple c, BodyLumps *lumps)
{
  BodyLumps s = *lumps;

  PetscFunctionBeginUser;
  if (!s) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(BodiesDetach(c->bodies, (void **)&s->value));
  for (PetscInt i = 0; i < s->n; i++) {
    PetscCall(PetscFree2(s->data[i].is, s->data[i].own));
    PetscCall(PetscFree3(s->data[i].capacity, s->data[i].source, s->data[i].content));
  }
  PetscCall(PetscFree2(s->lumps, s->data));
  PetscCall(PetscFree(*lumps));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode sum_over_ranks(void *couple, PetscReal v[])
{
  PetscFunctionBeginUser;
  PetscCall(BodiesSumLocal(((Couple)couple)->bodies, 1, v));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Values that bodies begin with */
static void start(BodyLumps s, Couple c)
{
  for (PetscInt k = 0; k < c->s->n && !s->started; k++)
    for (PetscInt e = 0; e < s->n * NUMBERS; e++)
      s->value[k * s->n * NUMBERS + e] = s->material[c->s->body_group[k] * s->n + e / NUMBERS].initial;
  s->started = PETSC_TRUE;
}

PetscErrorCode BodyLumpsSet(BodyLumps s, Couple c, Scalars scalars, PetscInt i, const ScalarParameters *par,
                            const PetscInt of_node[], PetscBool as_fluid)
{
  const PetscInt n = c->s->n;

  PetscFunctionBeginUser;
  if (!s) PetscFunctionReturn(PETSC_SUCCESS);
  start(s, c);
  PetscCall(PetscFree2(s->data[i].is, s->data[i].own));
  PetscCall(PetscFree3(s->data[i].capacity, s->data[i].source, s->data[i].content));
  PetscCall(PetscMalloc2(n, &s->data[i].is, n, &s->data[i].own));
  PetscCall(PetscCalloc3(n, &s->data[i].capacity, n, &s->data[i].source, n, &s->data[i].content));
  for (PetscInt k = 0; k < n; k++) {
    const ScalarMaterial *m      = s->material + c->s->body_group[k] * s->n + i;
    const PetscReal       volume = BodiesVolume(c->s, k);

    s->data[i].is[k]  = (PetscBool)(m->condition == SCALAR_BODY_LUMPED && !c->s->removed[k]);
    s->data[i].own[k] = c->s->own[k];
    if (!s->data[i].is[k]) continue;
    s->data[i].content[k]  = m->capacity * volume;
    s->data[i].capacity[k] = (m->capacity - (as_fluid ? par->capacity : 0)) * volume;
    s->data[i].source[k]   = m->source * volume;
  }
  s->lumps[i] = (ScalarLumps){.n        = n,
                              .is       = s->data[i].is,
                              .own      = s->data[i].own,
                              .of_node  = of_node,
                              .capacity = s->data[i].capacity,
                              .source   = s->data[i].source,
                              .content  = s->data[i].content,
                              .value    = s->value + i * NUMBERS,
                              .stride   = s->n * NUMBERS,
                              .sum      = sum_over_ranks,
                              .ctx      = c};
  PetscCall(ScalarsSetLumps(scalars, i, s->lumps + i));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodyLumpsAccept(BodyLumps s, Couple c)
{
  PetscFunctionBeginUser;
  for (PetscInt e = 0; s && e < c->s->n * s->n; e++) {
    PetscReal *value = s->value + e * NUMBERS;

    value[1] = value[0];
    value[0] = value[2];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodyLumpsVisit(BodyLumps s, Couple c, State state)
{
  PetscFunctionBeginUser;
  if (!s) PetscFunctionReturn(PETSC_SUCCESS);
  start(s, c);
  /* after a run without they begin anew */
  PetscCall(BodiesVisitOptional(c->bodies, state, "body_lumps", NUMBERS * s->n, s->value));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscReal BodyLumpsGetValue(BodyLumps s, PetscInt i, PetscInt k)
{
  return s->value[(k * s->n + i) * NUMBERS];
}
