/* PhaseCurve, retraced: see phase/curve.h. Where loops have run into each other they become one, and what is thinner
   than the lattice breaks: the zero line of the distance knows no loops. */
#include "compat.h"
#include "phase/contour.h"
#include "fem/edge.h"

#define LINES 4    /* lattice lines of a contour in its length */
#define SHORT 1e-3 /* of a step: such an edge says nothing of where its normal points; */
#define SPECK 1e-2 /* of a step's square: nor does such a loop, where the function is zero to round-off, bound a drop */

static PetscErrorCode distance_field(void *curve, PetscInt n, const PetscReal x[], PetscReal value[])
{
  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < n; i++) {
    PhasePoint p;

    PhaseCurveClosest((const PhaseCurve *)curve, x + 2 * i, PETSC_MAX_REAL / 4, &p);
    value[i] = p.d;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Is x within the loop? By how often a ray crosses its chords */
static PetscBool encloses(const PhaseCurve *c, PetscInt loop, const PetscReal x[2])
{
  PetscBool in = PETSC_FALSE;

  for (PetscInt i = c->first[loop]; i < c->first[loop + 1]; i++) {
    const PetscReal *a = c->x[c->edge[i]][0], *b = c->x[c->edge[i]][2];

    if ((a[1] > x[1]) != (b[1] > x[1]) && x[0] < a[0] + (x[1] - a[1]) / (b[1] - a[1]) * (b[0] - a[0]))
      in = (PetscBool)!in;
  }
  return in;
}

/* Numbers of the parts, for drops: a loop that is no hole, with the holes in it */
static PetscErrorCode number_components(PhaseCurve *c, PetscInt *n)
{
  PetscInt *part; /* [nloop] */

  PetscFunctionBeginUser;
  *n = 0;
  PetscCall(PetscMalloc1(c->nloop, &part));
  for (PetscInt l = 0; l < c->nloop; l++) part[l] = c->area[l] < 0 ? -1 : (*n)++;
  for (PetscInt l = 0; l < c->nloop; l++) {
    PetscReal smallest = PETSC_MAX_REAL;

    for (PetscInt o = 0; o < c->nloop && c->area[l] < 0; o++) {
      if (c->area[o] < 0 || c->area[o] >= smallest || !encloses(c, o, c->x[c->edge[c->first[l]]][1])) continue;
      smallest = c->area[o];
      part[l]  = part[o];
    }
  }
  for (PetscInt e = 0; e < c->n; e++) c->drop[e] = part[c->loop[e]];
  PetscCall(PetscFree(part));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What is no loop or edge to reckon with goes; an edge begins where the one before it ends */
static PetscErrorCode tidy(const PhaseCurve *from, PetscReal step, PhaseCurve *to)
{
  PetscBool *stays;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(from->n, &stays));
  for (PetscInt e = 0; e < from->n; e++)
    stays[e] = (PetscBool)(PetscAbsReal(from->area[from->loop[e]]) > SPECK * step * step &&
                           EdgeDistance2(from->x[e][0], from->x[e][2]) > PetscSqr(SHORT * step));
  PetscCall(PhaseCurveKeep(from, stays, to));
  for (PetscInt e = 0; e < to->n; e++) PetscCall(PetscArraycpy(to->x[e][0], to->x[to->before[e]][2], 2));
  PhaseCurveUpdate(to);
  PetscCall(PetscFree(stays));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PhaseCurveRetrace(const PhaseCurve *from, const PetscReal origin[2], PetscReal step, PhaseCurve *now,
                                 PetscInt *ncomponent)
{
  PhaseBox   box = {.h = LINES * step};
  PhaseCurve raw;
  PetscInt   n = 0, capacity = 0;
  PhaseEdge *edge = NULL;

  PetscFunctionBeginUser;
  for (PetscInt a = 0; a < 2; a++) {
    PetscReal low = PETSC_MAX_REAL, high = -PETSC_MAX_REAL;

    for (PetscInt e = 0; e < from->n; e++) {
      low  = PetscMin(low, from->ball[e][a] - from->ball[e][2]);
      high = PetscMax(high, from->ball[e][a] + from->ball[e][2]);
    }
    box.lower[a] = origin[a] + step * (PetscFloorReal((low - origin[a]) / step) - 1);
    box.upper[a] = origin[a] + step * (PetscCeilReal((high - origin[a]) / step) + 1);
  }
  PetscCall(PhaseContourTrace(&box, distance_field, (void *)from, 0, &n, &capacity, &edge));
  PetscCall(PhaseCurveGather(PETSC_COMM_SELF, n, edge, NULL, &raw));
  PetscCall(PetscFree(edge));
  PetscCall(tidy(&raw, step, now));
  PetscCall(PhaseCurveDestroy(&raw));
  PetscCall(number_components(now, ncomponent));
  PetscFunctionReturn(PETSC_SUCCESS);
}
