/* Elastic, scalars: solids as materials of what the flow carries (scalarphases.h). */
#include "compat.h"
#include "elastic.h"
#include "feet.h"
#include "elasticinside.h"
#include "impl.h"
#include "scalarphases.h"
#include "base/opt.h"
#include <strings.h>

PetscErrorCode ElasticAddPhases(Elastic *e, Couple c)
{
  const PetscInt n     = e->s->ngroups;
  PetscInt       solid = 0; /* what a membrane encloses is the fluid */
  ScalarPhase   *phase;
  char           adapt[16];

  PetscFunctionBeginUser;
  PetscCall(OptPeek("-sim_adapt", adapt, sizeof(adapt)));
  PetscCheck(!c->scalars || !e->aligned || e->anchored || !adapt[0] || !strcasecmp(adapt, "false"), c->comm,
             PETSC_ERR_SUP,
             "-sim_adapt %s with -couple_method aligned and -scalars: a step whose nodes have gone along with elastic particles cannot be taken again "
             "yet: remove it, or use -couple_method penalty",
             adapt);
  PetscCall(PetscMalloc1(n, &phase));
  for (PetscInt g = 0; g < n; g++)
    if (!e->s->group[g].membrane)
      phase[solid++] = (ScalarPhase){.name = e->s->group[g].name, .density = e->s->group[g].density};
  PetscCheck(!c->scalars || solid == 0 || solid == n, c->comm, PETSC_ERR_SUP,
             "-scalars with membranes and elastic solids in one scene are not there yet: leave out -scalars, or one of the two");
  PetscCall(CoupleAddPhases(c, solid, phase));
  PetscCall(PetscFree(phase));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- nodes that go along ---- */

/* Of the nearest solid that the mesh follows, or any in the middle of one */
static PetscReal find_distance(const void *ctx, const MeshLocal *l, const PetscReal x[])
{
  const Elastic       *e     = (const Elastic *)ctx;
  const AlignSurfaces *s     = ElasticSurfacesGet(e->surfaces);
  const PetscReal      reach = FEET_FAR * l->h;
  PetscReal            best  = reach, d;
  ElasticLabels        labels;

  PetscCallAbort(PETSC_COMM_SELF, ElasticAlignGetLabels(e->align, &labels));
  for (PetscInt k = 0; k < e->s->n; k++) {
    if (!labels.lined[k]) continue;
    for (DomainImages i = {0}; MeshNextImage(l, s->centre[k], s->radius[k] + reach, &i);) {
      PetscReal square = 0;

      for (PetscInt a = 0; a < l->dim; a++) square += PetscSqr(x[a] - i.at[a]);
      if (PetscSqrtReal(square) > s->radius[k] + reach) continue;
      PetscCallAbort(PETSC_COMM_SELF, (*s->distance)(s->ctx, k, i.at, 1, x, &d));
      best = PetscMin(best, PetscAbsReal(d));
    }
  }
  return best;
}

static PetscErrorCode carry(void *ctx, Remap remap, const AlignResult *r)
{
  Elastic       *e = (Elastic *)ctx;
  Couple         c = e->carried.c;
  const PetscInt n = c->loc->nnode_all * c->loc->dim;
  const FeetMesh m = {.mesh     = c->mesh,
                      .loc      = c->loc,
                      .remap    = remap,
                      .way      = e->carried.way,
                      .shift    = e->carried.shift,
                      .velocity = e->carried.velocity,
                      .distance = find_distance,
                      .ctx      = e,
                      .scalars  = CoupleCarriedScalars(c)};
  Feet           t;

  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(e->carried.way, n));
  if (CouplePhasesHaveBegun(c))
    PetscCall(FeetPredict(c->flow, c->step, (PetscBool)(c->step->order == 1), n, e->carried.way));
  PetscCall(FeetFind(&m, c->step, r, 0, NULL, &t));
  PetscCall(FeetDestroy(&t));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ElasticCarryScalars(Elastic *e, Couple c)
{
  ElasticCarried *t = &e->carried;
  const PetscInt  n = c->loc->nnode_all * c->loc->dim;

  PetscFunctionBeginUser;
  if (!c->scalars || !e->align || e->anchored) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscCalloc3(n, &t->way, n, &t->shift, n, &t->velocity));
  t->c = c;
  PetscCall(ElasticAlignSetCarry(e->align, carry, e));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- cells ---- */

PetscErrorCode ElasticSetPhases(Elastic *e, Couple c, const PetscReal x[])
{
  const PetscInt   n = c->loc->ncell_all;
  PetscInt        *cell;
  PetscReal       *part;
  const PetscReal *inside;
  ElasticInside    t;

  PetscFunctionBeginUser;
  if (!c->scalars) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscMalloc1(n, &cell));
  PetscCall(PetscCalloc1(n, &part));
  for (PetscInt i = 0; i < n; i++) cell[i] = -1;
  PetscCall(ElasticSurfacesSet(e->surfaces, x));
  PetscCall(ElasticInsideCreate(c->mesh, e->surfaces, e->align ? e->labels.lined : NULL, e->labels.cell_solid, &t));
  for (PetscInt k = 0; k < e->s->n && !SolidsHave(e->s, PETSC_TRUE); k++) {
    PetscCall(ElasticInsideFind(t, k, &inside));
    for (PetscInt i = 0; i < n; i++) {
      if (inside[i] <= part[i]) continue;
      cell[i] = e->s->group_of[k];
      part[i] = inside[i];
    }
  }
  PetscCall(ElasticInsideDestroy(&t));
  PetscCall(CoupleSetPhases(c, cell, part, e->carried.velocity));
  PetscCall(PetscFree(cell));
  PetscCall(PetscFree(part));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ElasticStartPhases(Elastic *e, Couple c)
{
  PetscFunctionBeginUser;
  if (!c->scalars || CouplePhasesHaveBegun(c)) PetscFunctionReturn(PETSC_SUCCESS);
  if (e->align && !e->ale) PetscCall(ElasticAlignUpdate(e->align, e->s->x, &e->labels));
  PetscCall(ElasticSetPhases(e, c, e->s->x));
  PetscCall(CoupleStartPhases(c));
  PetscFunctionReturn(PETSC_SUCCESS);
}
