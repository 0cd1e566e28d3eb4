/* Couple: who takes part in a step, in the order of their calls. A further participant is a file and a line here. */
#include "compat.h"
#include "impl.h"

static PetscErrorCode (*const PARTICIPANTS[])(Couple) = {
  CoupleAddWalls,       /* walls and openings */
  CoupleAddRigid,       /* rigid bodies */
  CoupleAddFitted,      /* those that are holes of the mesh */
  CoupleAddAle,         /* -mesh_deform: the mesh goes along */
  CoupleAddScalars,     /* what the flow carries (before who takes over an old mesh) */
  CoupleAddMethod,      /* how the flow sees surfaces (-couple_method) */
  CoupleAddSurfaces,    /* distances from bodies for laws of the flow */
  CoupleAddJoints,      /* loads that change with the motion */
  CoupleAddInterior,    /* bodies without fluid inside */
  CoupleAddSlip,        /* velocities of surfaces beside the rigid motion */
  CoupleAddStartValues, /* start values that go with bodies */
  CoupleAddCarry,       /* the residual of a step, added to the right-hand side of the next */
  CoupleAddContact,     /* contact solved with the flow */
  CoupleAddFlowRate,    /* uniform force that holds a flow rate */
};

PetscErrorCode CoupleAddParticipants(Couple c)
{
  PetscFunctionBeginUser;
  for (size_t i = 0; i < PETSC_STATIC_ARRAY_LENGTH(PARTICIPANTS); i++) PetscCall((*PARTICIPANTS[i])(c));
  PetscFunctionReturn(PETSC_SUCCESS);
}
