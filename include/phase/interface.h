/* PhaseInterface: the interface of all drops, curves in the plane or surfaces in space; one of the two is empty. */
#pragma once
#include "base/state.h"
#include "phase/curve.h"
#include "phase/sheet.h"

typedef struct {
  PhaseCurve curve;
  PhaseSheet sheet;
} PhaseInterface;

/* How many edges or faces */
static inline PetscInt PhaseInterfaceSize(const PhaseInterface *f)
{
  return f->curve.n + f->sheet.n;
}
static inline PetscErrorCode PhaseInterfaceDestroy(PhaseInterface *f)
{
  PetscFunctionBeginUser;
  PetscCall(PhaseCurveDestroy(&f->curve));
  PetscCall(PhaseSheetDestroy(&f->sheet));
  PetscFunctionReturn(PETSC_SUCCESS);
}
/* interface.c. A new one that is the same. */
PetscErrorCode PhaseInterfaceCopy(const PhaseInterface *from, PhaseInterface *to);
/* That of a checkpoint. Collective. */
PetscErrorCode PhaseInterfaceVisit(State, PetscInt dim, PhaseInterface *);
/* As the functions of PhaseCurve and PhaseSheet */
static inline void PhaseInterfaceUpdate(PhaseInterface *f)
{
  if (f->sheet.n) PhaseSheetUpdate(&f->sheet);
  else PhaseCurveUpdate(&f->curve);
}
static inline void PhaseInterfaceClosest(const PhaseInterface *f, const PetscReal x[], PetscReal reach, PhasePoint *p)
{
  if (f->sheet.n) PhaseSheetClosest(&f->sheet, x, reach, p);
  else PhaseCurveClosest(&f->curve, x, reach, p);
}
static inline void PhaseInterfaceApproach(const PhaseInterface *f, const PetscReal x[], const PetscReal out[],
                                          PhasePoint *p)
{
  if (f->sheet.n) PhaseSheetApproach(&f->sheet, x, out, p);
  else PhaseCurveApproach(&f->curve, x, out, p);
}
static inline void PhaseInterfaceMeasure(const PhaseInterface *f, PetscInt drop, PhaseSums *s)
{
  if (f->sheet.n) PhaseSheetMeasure(&f->sheet, drop, s);
  else PhaseCurveMeasure(&f->curve, drop, s);
}
static inline PetscErrorCode PhaseInterfaceShift(PhaseInterface *f, PetscInt drop, PetscReal way)
{
  PetscFunctionBeginUser;
  if (f->sheet.n) PetscCall(PhaseSheetShift(&f->sheet, drop, way));
  else PetscCall(PhaseCurveShift(&f->curve, drop, way));
  PetscFunctionReturn(PETSC_SUCCESS);
}
/* Of edge or face e: the number of what it bounds, and its middle; false: it is along a wall */
static inline PetscBool PhaseInterfacePiece(const PhaseInterface *f, PetscInt e, PetscInt *drop,
                                            const PetscReal *middle[])
{
  *drop   = f->sheet.n ? f->sheet.drop[e] : f->curve.drop[e];
  *middle = f->sheet.n ? f->sheet.x[e][4] : f->curve.x[e][1];
  return (PetscBool) !(f->sheet.n ? f->sheet.wall : f->curve.wall)[e];
}
