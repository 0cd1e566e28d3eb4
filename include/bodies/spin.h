/* Spin: the free rotation of a rigid body in space. Called by contact and bodies/advance.c. Scheme of Simo & Wong (Int.
   J. Numer. Meth. Engng 31, 1991).
   In a step the body turns by the vector
     turn = dt/2 (w + R^T w'),   R = exp(turn),
   the mean of the angular velocities at both ends, that of the end as the beginning sees it. Second order; without
   torque it keeps angular momentum and energy whatever the step. All in space axes; local and cheap. */
#pragma once
#include <petscsys.h>

/* One step under torque T [3]: w [3] becomes the angular velocity after it, R I R^T w' = I w + dt T. inertia [6]: I at
   the beginning (xx yy zz xy xz yz, positive definite). A quasi-Newton iteration, for turns up to about 1 rad. */
void BodySpin(PetscReal dt, const PetscReal inertia[6], const PetscReal T[3], PetscReal w[3]);
/* turn [3] between the angular velocities of two times dt apart */
void BodyTurn(PetscReal dt, const PetscReal w_old[3], const PetscReal w[3], PetscReal turn[3]);
