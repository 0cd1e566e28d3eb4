/* PhaseSurfaces: see phase/surfaces.h. */
#include "compat.h"
#include "phase/surfaces.h"

struct _p_PhaseSurfaces {
  const PhaseCurve *curve;
  PetscInt          number, sides;
  PetscBool         own, inactive;
  PetscReal         centre[1][3], radius, round, volume;
  AlignSurfaces     table;
};

static PetscErrorCode distance(void *ctx, PetscInt k, const PetscReal at[3], PetscInt m, const PetscReal x[],
                               PetscReal d[])
{
  const struct _p_PhaseSurfaces *s = (const struct _p_PhaseSurfaces *)ctx;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < m; i++) {
    const PetscReal r[2] = {x[2 * i] - at[0] + s->centre[k][0], x[2 * i + 1] - at[1] + s->centre[k][1]};
    PhasePoint      p;

    PhaseCurveClosest(s->curve, r, PETSC_MAX_REAL / 4, &p);
    d[i] = p.d;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode project(void *ctx, PetscInt k, PetscInt m, const PetscReal x[], PetscReal y[])
{
  PetscFunctionBeginUser;
  (void)k;
  for (PetscInt i = 0; i < m; i++) {
    PhasePoint p;

    PhaseCurveClosest(((const struct _p_PhaseSurfaces *)ctx)->curve, x + 2 * i, PETSC_MAX_REAL / 4, &p);
    for (PetscInt a = 0; a < 2; a++) y[2 * i + a] = p.y[a];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode approach(void *ctx, PetscInt k, PetscInt m, const PetscReal x[], const PetscReal out[],
                               PetscReal y[])
{
  PetscFunctionBeginUser;
  (void)k;
  for (PetscInt i = 0; i < m; i++) {
    PhasePoint p;

    PhaseCurveApproach(((const struct _p_PhaseSurfaces *)ctx)->curve, x + 2 * i, out + 2 * i, &p);
    for (PetscInt a = 0; a < 2; a++) y[2 * i + a] = p.y[a];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PhaseSurfacesCreate(PetscReal largest, PhaseSurfaces *surfaces)
{
  PhaseSurfaces s;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&s));
  s->own    = PETSC_TRUE;
  s->table  = (AlignSurfaces){.ctx             = s,
                              .n               = 1,
                              .nall            = 1,
                              .largest         = largest,
                              .number          = &s->number,
                              .own             = &s->own,
                              .inactive_inside = &s->inactive,
                              .centre          = (const PetscReal(*)[3])s->centre,
                              .radius          = &s->radius,
                              .round           = &s->round,
                              .volume          = &s->volume,
                              .distance        = distance,
                              .project         = project,
                              .approach        = approach};
  *surfaces = s;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PhaseSurfacesDestroy(PhaseSurfaces *surfaces)
{
  PetscFunctionBeginUser;
  PetscCall(PetscFree(*surfaces));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PhaseSurfacesSetWalls(PhaseSurfaces s, PetscInt sides)
{
  PetscFunctionBeginUser;
  s->sides         = sides;
  s->table.ends_on = sides ? &s->sides : NULL;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PhaseSurfacesSetClosed(PhaseSurfaces s, const PetscBool closed[])
{
  PetscFunctionBeginUser;
  s->table.closed = closed;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PhaseSurfacesSet(PhaseSurfaces s, const PhaseCurve *c)
{
  PetscReal low[2] = {PETSC_MAX_REAL, PETSC_MAX_REAL}, high[2] = {-PETSC_MAX_REAL, -PETSC_MAX_REAL};

  PetscFunctionBeginUser;
  s->curve  = c;
  s->volume = 0;
  for (PetscInt e = 0; e < c->n; e++)
    for (PetscInt a = 0; a < 2; a++) {
      low[a]  = PetscMin(low[a], c->ball[e][a] - c->ball[e][2]);
      high[a] = PetscMax(high[a], c->ball[e][a] + c->ball[e][2]);
    }
  for (PetscInt l = 0; l < c->nloop; l++) s->volume += c->area[l];
  for (PetscInt a = 0; a < 2; a++) s->centre[0][a] = c->n ? 0.5 * (low[a] + high[a]) : 0;
  s->radius = c->n ? 0.5 * PetscHypotReal(high[0] - low[0], high[1] - low[1]) : 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}

const AlignSurfaces *PhaseSurfacesGet(PhaseSurfaces s)
{
  return &s->table;
}
