/* Drops: see phase/drops.h. */
#include "compat.h"
#include "impl.h"
#include "base/opt.h"
#include "shape/host.h"
#include "shape/material.h"

#define FINE      20 /* edges of the curve at the start in a cell's length */
#define MIN_EDGES 64 /* such edges of a drop */
#define MAX_EDGES 2000

/* ---- options ---- */

static PetscErrorCode read_material(DropGroup *g)
{
  char      name[OPT_NAME];
  PetscBool given;

  PetscFunctionBeginUser;
  g->density = 1;
  PetscCall(OptReal(OptJoin("-particle_", g->name, "_density", name), &g->density));
  g->viscosity = 0; /* the fluid's */
  PetscCall(OptReal(OptJoin("-particle_", g->name, "_viscosity", name), &g->viscosity));
  PetscCall(OptHas(OptJoin("-particle_", g->name, "_surface_tension", name), &given));
  PetscCheck(given, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT, "Group '%s' is a fluid and has no surface tension: give %s",
             g->name, name);
  PetscCall(OptReal(name, &g->tension));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- life cycle ---- */

static PetscErrorCode list_groups(Drops d)
{
  ParticleGroup *list;

  PetscFunctionBeginUser;
  PetscCall(ParticleListGroups(MATERIAL_FLUID, MATERIAL_FLUID, &d->s.ngroups, &list));
  PetscCall(PetscCalloc1(d->s.ngroups, &d->group));
  for (PetscInt g = 0; g < d->s.ngroups; g++)
    PetscCall(PetscStrncpy(d->group[g].name, list[g].name, sizeof(d->group[g].name)));
  PetscCall(PetscFree(list));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DropsCreate(MPI_Comm comm, PetscInt dim, Drops *drops)
{
  Drops d;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&d));
  d->comm = comm;
  *drops  = d;
  PetscCall(list_groups(d));
  if (!d->s.ngroups) {
    PetscCall(DropsDestroy(drops));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCheck(dim == 2, comm, PETSC_ERR_SUP,
             "-particle_%s_material fluid: drops are for the plane so far: give a mesh of two dimensions",
             d->group[0].name);
  PetscCall(PetscCalloc1(d->s.ngroups, &d->s.drop));
  d->s.group = d->group;
  d->s.n = d->s.numbers = d->s.ngroups;
  for (PetscInt g = 0; g < d->s.ngroups; g++) {
    DropGroup *group = d->group + g;
    ShapeMass  mass;

    PetscCall(read_material(group));
    PetscCall(ParticleCreateShape(group->name, dim, &group->shape));
    PetscCall(ParticleReadPosition(group->name, "drops", dim, group->x, &group->angle));
    PetscCall(ShapeGetMass(group->shape, &mass));
    d->s.drop[g] = (Drop){.number = g, .group = g, .target = mass.volume};
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DropsDestroy(Drops *drops)
{
  Drops d = *drops;

  PetscFunctionBeginUser;
  if (!d) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt g = 0; g < d->s.ngroups; g++) PetscCall(ShapeDestroy(&d->group[g].shape));
  PetscCall(PetscFree(d->group));
  PetscCall(PetscFree(d->s.drop));
  PetscCall(PhaseCurveDestroy(&d->s.curve));
  PetscCall(PetscFree(*drops));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DropsGetState(Drops d, DropsState **state)
{
  PetscFunctionBeginUser;
  *state = &d->s;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DropsView(Drops d, PetscViewer viewer)
{
  PetscFunctionBeginUser;
  for (PetscInt g = 0; g < d->s.ngroups; g++)
    PetscCall(PetscViewerASCIIPrintf(viewer, "drop group '%s': density %g, viscosity %g, surface tension %g\n",
                                     d->group[g].name, (double)d->group[g].density, (double)d->group[g].viscosity,
                                     (double)d->group[g].tension));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- the start ---- */

/* Points of the surface, an even number *n, in space: x [*n][2], the caller's to free */
static PetscErrorCode sample(const DropGroup *g, PetscReal h, PetscInt *n, PetscReal **x)
{
  const PetscReal c = PetscCosReal(g->angle), s = PetscSinReal(g->angle);
  PetscReal       first[2 * MIN_EDGES], weight[MIN_EDGES], length = 0, *w;
  ShapeMass       mass;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetMass(g->shape, &mass));
  PetscCall(ShapeSurface(g->shape, MIN_EDGES, first, weight));
  for (PetscInt i = 0; i < MIN_EDGES; i++) length += weight[i];
  *n = 2 * (PetscInt)PetscMin(MAX_EDGES, PetscMax(MIN_EDGES, FINE * length / h));
  PetscCall(PetscMalloc1(2 * *n, x));
  PetscCall(PetscMalloc1(*n, &w));
  PetscCall(ShapeSurface(g->shape, *n, *x, w));
  PetscCall(PetscFree(w));
  for (PetscInt i = 0; i < *n; i++) {
    const PetscReal r[2] = {(*x)[2 * i] - mass.centroid[0], (*x)[2 * i + 1] - mass.centroid[1]};

    (*x)[2 * i]     = g->x[0] + c * r[0] - s * r[1];
    (*x)[2 * i + 1] = g->x[1] + s * r[0] + c * r[1];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DropsStart(Drops d, PetscReal h, PhaseCurve *curve)
{
  PetscInt  *count, *drop, total = 0;
  PetscReal *all = NULL, **x;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc3(d->s.ngroups, &count, d->s.ngroups, &drop, d->s.ngroups, &x));
  for (PetscInt g = 0; g < d->s.ngroups; g++) {
    PetscCall(sample(d->group + g, h, &count[g], &x[g]));
    drop[g] = g;
    total += count[g];
  }
  PetscCall(PetscMalloc1(2 * total, &all));
  total = 0;
  for (PetscInt g = 0; g < d->s.ngroups; g++) {
    PetscCall(PetscArraycpy(all + 2 * total, x[g], 2 * count[g]));
    total += count[g];
    PetscCall(PetscFree(x[g]));
  }
  PetscCall(PhaseCurveFromLines(d->s.ngroups, count, all, drop, curve));
  PetscCall(PetscFree(all));
  PetscCall(PetscFree3(count, drop, x));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscInt DropsFind(const DropsState *s, PetscInt number)
{
  for (PetscInt i = 0; i < s->n && number >= 0; i++)
    if (s->drop[i].number == number) return i;
  return -1;
}

/* ---- checkpoint ---- */

PetscErrorCode DropsVisitState(void *drops, State state)
{
  DropsState *s    = &((Drops)drops)->s;
  PetscInt    n[4] = {s->n, s->numbers, s->merged, s->broken}, *which;
  PetscReal  *value;

  PetscFunctionBeginUser;
  PetscCall(StateInts(state, "counts", 4, n));
  if (StateIsLoading(state)) {
    s->n       = n[0];
    s->numbers = n[1];
    s->merged  = n[2];
    s->broken  = n[3];
    PetscCall(PetscFree(s->drop));
    PetscCall(PetscCalloc1(s->n, &s->drop));
  }
  PetscCall(StateReals(state, "lost", 1, &s->lost));
  PetscCall(PetscMalloc2(2 * s->n, &which, s->n, &value));
  for (PetscInt i = 0; i < s->n; i++) {
    which[2 * i]     = s->drop[i].number;
    which[2 * i + 1] = s->drop[i].group;
    value[i]         = s->drop[i].target;
  }
  PetscCall(StateInts(state, "drops", 2 * s->n, which));
  PetscCall(StateReals(state, "targets", s->n, value));
  for (PetscInt i = 0; i < s->n; i++)
    s->drop[i] = (Drop){.number = which[2 * i], .group = which[2 * i + 1], .target = value[i]};
  PetscCall(PetscFree2(which, value));
  PetscFunctionReturn(PETSC_SUCCESS);
}
