/* One place for differences between PETSc releases (3.18 to current). Layer 0. */
#pragma once
#include <petsc.h>

#if PETSC_VERSION_LT(3, 18, 0)
  #error "tumble needs PETSc 3.18 or newer"
#endif
#if PETSC_VERSION_LT(3, 19, 0) && !defined(PETSC_SUCCESS)
  #define PETSC_SUCCESS ((PetscErrorCode)0)
#endif
