/* DropDistance: see dropdistance.h. */
#include "compat.h"
#include "dropdistance.h"
#include "base/algebra.h"
#include "base/domain.h"

struct _p_DropDistance {
  Drops          drops;
  DropsState    *s;
  PetscInt       dim;
  PetscReal      lower[3], upper[3], period[3];
  PetscInt       started;   /* the interface is not that of the start any more */
  PhaseInterface interface; /* in space nothing at the start, where the drops are asked */
};

PetscErrorCode DropDistanceCreate(Drops drops, PetscInt dim, const PetscReal lower[], const PetscReal upper[],
                                  const PetscReal period[], PetscReal h, DropDistance *distance)
{
  PhaseBox     box = {.h = h};
  DropDistance f;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&f));
  f->drops = drops;
  f->dim   = dim;
  PetscCall(DropsGetState(drops, &f->s));
  PetscCall(PetscArraycpy(f->lower, lower, dim));
  PetscCall(PetscArraycpy(f->upper, upper, dim));
  PetscCall(PetscArraycpy(f->period, period, dim));
  if (dim == 3) PetscCall(DropsStartBox(drops, lower, upper));
  else {
    for (PetscInt a = 0; a < 2; a++) {
      box.lower[a]  = lower[a];
      box.upper[a]  = upper[a];
      box.period[a] = period[a];
    }
    box.wets = DropsWet(f->s) ? 15 : 0;
    PetscCall(DropsStart(drops, &box, &f->interface.curve));
  }
  *distance = f;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DropDistanceDestroy(DropDistance *f)
{
  PetscFunctionBeginUser;
  if (!*f) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PhaseInterfaceDestroy(&(*f)->interface));
  PetscCall(PetscFree(*f));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DropDistanceAt(DropDistance f, const PetscReal x[3], PetscReal reach, PetscReal margin, PetscReal *d)
{
  PetscFunctionBeginUser;
  for (DomainImages i = {0}; DomainNextImage(f->period, f->lower, f->upper, x, PETSC_MAX_REAL / 4, &i);) {
    PhasePoint p;

    if (f->dim == 3 && !f->started) PetscCall(DropsStartDistance(f->drops, 1, i.at, &p.d));
    else PhaseInterfaceClosest(&f->interface, i.at, PetscMin(reach, *d) + margin, &p);
    *d = PetscMin(*d, PetscMax(0, PetscAbsReal(p.d) - margin));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* way [n][3] of the drops in this time, none longer than `most` */
static PetscErrorCode find_displacements(DropDistance f, PetscReal time, PetscReal most, PetscReal way[])
{
  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < f->s->n; k++) {
    const PetscReal *u = f->s->drop[k].velocity, size = time * PetscSqrtReal(dot3(u, u));

    for (PetscInt a = 0; a < 3; a++) way[3 * k + a] = time * u[a] * (size > most ? most / size : 1);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Nodes [*n][dim] of edge or face e */
static PetscReal *nodes_of(PhaseInterface *f, PetscInt dim, PetscInt e, PetscInt *n)
{
  *n = dim == 2 ? 3 : 9;
  return dim == 2 ? &f->curve.x[e][0][0] : &f->sheet.x[e][0][0];
}

/* A copy of the interface that drops have, moved */
static PetscErrorCode move_interface(DropDistance f, PetscReal time, PetscReal most, PhaseInterface *to)
{
  PetscReal *way;

  PetscFunctionBeginUser;
  PetscCall(PhaseInterfaceCopy(&f->s->interface, to));
  PetscCall(PetscMalloc1(3 * f->s->n, &way));
  PetscCall(find_displacements(f, time, most, way));
  for (PetscInt e = 0; e < PhaseInterfaceSize(to); e++) {
    const PetscReal *middle;
    PetscInt         n, k;
    PetscReal       *x = nodes_of(to, f->dim, e, &n);

    (void)PhaseInterfacePiece(to, e, &k, &middle);
    k = DropsFind(f->s, k);
    for (PetscInt i = 0; i < f->dim * n && k >= 0; i++) x[i] += way[3 * k + i % f->dim];
  }
  PhaseInterfaceUpdate(to);
  PetscCall(PetscFree(way));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DropDistanceSet(DropDistance f, PetscReal time, PetscReal most)
{
  PhaseInterface now;

  PetscFunctionBeginUser;
  PetscCall(move_interface(f, time, most, &now));
  PetscCall(PhaseInterfaceDestroy(&f->interface));
  f->interface = now;
  f->started   = 1;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DropDistanceMoved(DropDistance f, PetscReal time, PetscReal *way)
{
  PhaseInterface now;

  PetscFunctionBeginUser;
  *way = 0;
  PetscCall(move_interface(f, time, PETSC_MAX_REAL, &now));
  for (PetscInt e = 0; e < PhaseInterfaceSize(&now); e++) {
    PetscInt         n, drop;
    const PetscReal *middle, *x = nodes_of(&now, f->dim, e, &n);

    if (!PhaseInterfacePiece(&now, e, &drop, &middle)) continue;
    for (PetscInt i = 0; i < n; i++) {
      PetscReal at[3] = {0, 0, 0}, d = PETSC_MAX_REAL;

      PetscCall(PetscArraycpy(at, x + f->dim * i, f->dim));
      PetscCall(DropDistanceAt(f, at, PETSC_MAX_REAL / 4, 0, &d));
      *way = PetscMax(*way, d);
    }
  }
  PetscCall(PhaseInterfaceDestroy(&now));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DropDistanceVisit(DropDistance f, State state)
{
  PetscFunctionBeginUser;
  PetscCall(StateInts(state, "drops_started", 1, &f->started));
  PetscCall(PhaseInterfaceVisit(state, f->dim, &f->interface));
  PetscFunctionReturn(PETSC_SUCCESS);
}
