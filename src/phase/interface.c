/* PhaseInterface: see phase/interface.h. */
#include "compat.h"
#include "phase/interface.h"

/* Nodes of an edge after those of another */
static PetscErrorCode visit_curve(State state, PhaseCurve *curve)
{
  PetscInt   n = curve->n, *link; /* [n][3] */
  PhaseCurve c = *curve;

  PetscFunctionBeginUser;
  PetscCall(StateInts(state, "drops_edges", 1, &n));
  if (StateIsLoading(state)) PetscCall(PhaseCurveCreate(n, &c));
  PetscCall(PetscMalloc1(3 * n, &link));
  for (PetscInt e = 0; e < n; e++) {
    link[3 * e]     = c.next[e];
    link[3 * e + 1] = c.drop[e];
    link[3 * e + 2] = c.wall[e];
  }
  PetscCall(StateReals(state, "drops_curve", 6 * n, (PetscReal *)c.x));
  PetscCall(StateInts(state, "drops_links", 3 * n, link));
  for (PetscInt e = 0; e < n && StateIsLoading(state); e++) {
    c.next[e]           = link[3 * e];
    c.before[c.next[e]] = e;
    c.drop[e]           = link[3 * e + 1];
    c.wall[e]           = (PetscBool)link[3 * e + 2];
  }
  PetscCall(PetscFree(link));
  if (StateIsLoading(state)) {
    PhaseCurveLink(&c);
    PetscCall(PhaseCurveDestroy(curve));
    *curve = c;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode visit_sheet(State state, PhaseSheet *sheet)
{
  PetscInt   n[3] = {sheet->n, sheet->nnode, sheet->npart}, *wall;
  PhaseSheet s    = *sheet;

  PetscFunctionBeginUser;
  PetscCall(StateInts(state, "drops_faces", 3, n));
  if (StateIsLoading(state)) PetscCall(PhaseSheetCreate(n[0], n[1], n[2], &s));
  PetscCall(StateReals(state, "drops_sheet", 27 * n[0], (PetscReal *)s.x));
  PetscCall(StateInts(state, "drops_nodes", 9 * n[0], (PetscInt *)s.node));
  PetscCall(StateInts(state, "drops_numbers", n[0], s.drop));
  PetscCall(StateInts(state, "drops_parts", n[0], s.part));
  PetscCall(PetscMalloc1(n[0], &wall));
  for (PetscInt e = 0; e < n[0]; e++) wall[e] = s.wall[e];
  PetscCall(StateInts(state, "drops_walls", n[0], wall));
  for (PetscInt e = 0; e < n[0]; e++) s.wall[e] = (PetscBool)wall[e];
  PetscCall(PetscFree(wall));
  if (!StateIsLoading(state)) PetscFunctionReturn(PETSC_SUCCESS);
  PhaseSheetUpdate(&s);
  PetscCall(PhaseSheetDestroy(sheet));
  *sheet = s;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PhaseInterfaceVisit(State state, PetscInt dim, PhaseInterface *f)
{
  PetscFunctionBeginUser;
  if (dim == 2) PetscCall(visit_curve(state, &f->curve));
  else PetscCall(visit_sheet(state, &f->sheet));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode copy_sheet(const PhaseSheet *from, PhaseSheet *to)
{
  PetscFunctionBeginUser;
  PetscCall(PhaseSheetCreate(from->n, from->nnode, from->npart, to));
  PetscCall(PetscArraycpy(to->x, from->x, from->n));
  PetscCall(PetscArraycpy(to->ball, from->ball, from->n));
  PetscCall(PetscArraycpy(to->whole, from->whole, 4));
  PetscCall(PetscArraycpy(to->node, from->node, from->n));
  PetscCall(PetscArraycpy(to->drop, from->drop, from->n));
  PetscCall(PetscArraycpy(to->part, from->part, from->n));
  PetscCall(PetscArraycpy(to->volume, from->volume, from->npart));
  PetscCall(PetscArraycpy(to->closes, from->closes, from->npart));
  PetscCall(PetscArraycpy(to->wall, from->wall, from->n));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PhaseInterfaceCopy(const PhaseInterface *from, PhaseInterface *to)
{
  PetscFunctionBeginUser;
  *to = (PhaseInterface){0};
  if (from->sheet.n) PetscCall(copy_sheet(&from->sheet, &to->sheet));
  if (from->curve.n) PetscCall(PhaseCurveKeep(&from->curve, NULL, &to->curve));
  PetscFunctionReturn(PETSC_SUCCESS);
}
