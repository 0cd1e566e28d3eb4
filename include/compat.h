/* One place for differences between PETSc releases (3.18 to current). */
#pragma once
#include <petsc.h>

#if PETSC_VERSION_LT(3, 18, 0)
  #error "tumble needs PETSc 3.18 or newer"
#endif
#if defined(PETSC_USE_COMPLEX)
  #error \
    "tumble needs a PETSc of real numbers, this one has complex ones: name another (make PETSC_DIR=... PETSC_ARCH=...)"
#endif
#if !defined(PETSC_USE_REAL_DOUBLE)
  #error \
    "tumble needs a PETSc of double precision, this one has another: name another (make PETSC_DIR=... PETSC_ARCH=...)"
#endif
#if PETSC_VERSION_LT(3, 19, 0) && !defined(PETSC_SUCCESS)
  #define PETSC_SUCCESS ((PetscErrorCode)0)
#endif
/* MPI type of PetscBool */
#if PETSC_VERSION_LT(3, 24, 0)
  #define COMPAT_MPI_BOOL MPIU_BOOL
#else
  #define COMPAT_MPI_BOOL MPI_C_BOOL
#endif

/* What a function that destroys a context is given for it: the context or, later, its address */
#if PETSC_VERSION_LT(3, 23, 0)
  #define COMPAT_DESTROYED(given)    (given)
  #define COMPAT_TO_DESTROY(context) (context)
#else
  #define COMPAT_DESTROYED(given)    (*(void **)(given))
  #define COMPAT_TO_DESTROY(context) ((void *)&(context))
#endif

/* DMPlexCreateBoxMesh() of quadrilaterals or hexahedra with their edges and faces; periodic cells keep coordinates of
   their own */
static inline PetscErrorCode CompatCreateBoxMesh(MPI_Comm comm, PetscInt dim, const PetscInt cells[],
                                                 const PetscReal lower[], const PetscReal upper[],
                                                 const DMBoundaryType periodicity[], DM *dm)
{
  PetscFunctionBeginUser;
#if PETSC_VERSION_LT(3, 22, 0)
  PetscCall(DMPlexCreateBoxMesh(comm, dim, PETSC_FALSE, cells, lower, upper, periodicity, PETSC_TRUE, dm));
#else
  PetscCall(
    DMPlexCreateBoxMesh(comm, dim, PETSC_FALSE, cells, lower, upper, periodicity, PETSC_TRUE, 0, PETSC_TRUE, dm));
#endif
  PetscFunctionReturn(PETSC_SUCCESS);
}
