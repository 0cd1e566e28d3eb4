/* PhaseSurfaces: see phase/surfaces.h. */
#include "compat.h"
#include "phase/surfaces.h"
#include "base/algebra.h"

#define OPPOSITE (-0.7) /* cosine between the ways to the two sides of a film */

struct _p_PhaseSurfaces {
  const PhaseInterface *interface;
  Drops                 start; /* in space, before there is one; else NULL */
  PetscInt              number, sides, dim;
  PetscBool             own, inactive;
  PetscReal             centre[1][3], radius, round, volume, film;
  AlignSurfaces         table;
};

/* x, outside, is between the closest point p and a part of the interface that faces it, in a film that is too thin: by
   how much, negative; else p's distance */
static PetscReal distance_in_film(const struct _p_PhaseSurfaces *s, const PetscReal x[2], const PhasePoint *p)
{
  const PetscReal in[2] = {p->y[0] - x[0], p->y[1] - x[1]};
  PhasePoint      q;
  PetscReal       cosine;

  if (p->d <= 0 || p->d >= s->film) return p->d;
  PhaseCurveApproach(&s->interface->curve, x, in, &q);
  if (q.edge < 0 || q.d + p->d >= s->film || q.d <= 0) return p->d;
  cosine = ((q.y[0] - x[0]) * in[0] + (q.y[1] - x[1]) * in[1]) / (q.d * p->d);
  return cosine < OPPOSITE ? q.d + p->d - s->film : p->d;
}

static PetscErrorCode distance(void *ctx, PetscInt k, const PetscReal at[3], PetscInt m, const PetscReal x[],
                               PetscReal d[])
{
  const struct _p_PhaseSurfaces *s   = (const struct _p_PhaseSurfaces *)ctx;
  const PetscInt                 dim = s->dim;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < m; i++) {
    PetscReal  r[3];
    PhasePoint p;

    for (PetscInt a = 0; a < dim; a++) r[a] = x[dim * i + a] - at[a] + s->centre[k][a];
    if (s->start) {
      PetscCall(DropsStartDistance(s->start, 1, r, d + i));
      continue;
    }
    PhaseInterfaceClosest(s->interface, r, PETSC_MAX_REAL / 4, &p);
    d[i] = s->film > 0 && p.edge >= 0 ? distance_in_film(s, r, &p) : p.d;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode approach(void *ctx, PetscInt k, PetscInt m, const PetscReal x[], const PetscReal out[],
                               PetscReal y[])
{
  const struct _p_PhaseSurfaces *s   = (const struct _p_PhaseSurfaces *)ctx;
  const PetscInt                 dim = s->dim;

  PetscFunctionBeginUser;
  (void)k;
  if (s->start) {
    PetscCall(DropsStartClosest(s->start, m, x, y));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  for (PetscInt i = 0; i < m; i++) {
    PhasePoint p;

    if (out) PhaseInterfaceApproach(s->interface, x + dim * i, out + dim * i, &p);
    else PhaseInterfaceClosest(s->interface, x + dim * i, PETSC_MAX_REAL / 4, &p);
    for (PetscInt a = 0; a < dim; a++) y[dim * i + a] = p.y[a];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode project(void *ctx, PetscInt k, PetscInt m, const PetscReal x[], PetscReal y[])
{
  PetscFunctionBeginUser;
  PetscCall(approach(ctx, k, m, x, NULL, y));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PhaseSurfacesCreate(PetscInt dim, PetscReal largest, PhaseSurfaces *surfaces)
{
  PhaseSurfaces s;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&s));
  s->dim    = dim;
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

PetscErrorCode PhaseSurfacesSetFilm(PhaseSurfaces s, PetscReal film)
{
  PetscFunctionBeginUser;
  s->film = film;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PhaseSurfacesSetClosed(PhaseSurfaces s, const PetscBool closed[])
{
  PetscFunctionBeginUser;
  s->table.closed = closed;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PhaseSurfacesSet(PhaseSurfaces s, const PhaseInterface *f)
{
  const PetscReal *whole = s->dim == 2 ? f->curve.whole : f->sheet.whole;

  PetscFunctionBeginUser;
  s->interface = f;
  s->start     = NULL;
  s->volume    = 0;
  for (PetscInt l = 0; l < f->curve.nloop; l++) s->volume += f->curve.area[l];
  for (PetscInt p = 0; p < f->sheet.npart; p++) s->volume += f->sheet.volume[p];
  for (PetscInt a = 0; a < s->dim && PhaseInterfaceSize(f); a++) s->centre[0][a] = whole[a];
  s->radius = whole[s->dim];
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PhaseSurfacesSetStart(PhaseSurfaces s, Drops drops)
{
  PetscFunctionBeginUser;
  s->start = drops;
  PetscCall(DropsStartBall(drops, s->centre[0], &s->radius, &s->volume));
  PetscFunctionReturn(PETSC_SUCCESS);
}

const AlignSurfaces *PhaseSurfacesGet(PhaseSurfaces s)
{
  return &s->table;
}
