/* Versions: see versions.h. The Makefile writes build/version.h. */
#include "compat.h"
#include "versions.h"
#include <petscpkg_version.h>
#include <string.h>
#if defined(__has_include)
  #if __has_include("version.h")
    #include "version.h"
  #endif
#endif
#if !defined(TUMBLE_COMMIT)
  #define TUMBLE_COMMIT "unknown"
#endif
#if !defined(TUMBLE_VERSION)
  #define TUMBLE_VERSION "unknown"
#endif

#if defined(PETSC_USE_DEBUG) || !defined(__OPTIMIZE__) || defined(__SANITIZE_ADDRESS__)
  #define OPTIMISED PETSC_FALSE
#else
  #define OPTIMISED PETSC_TRUE
#endif

/* First line of the library's self-description, up to the first comma ("Open MPI v4.1.4") */
static PetscErrorCode get_mpi_version(char version[], size_t len)
{
  char text[MPI_MAX_LIBRARY_VERSION_STRING];
  int  n;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Get_library_version(text, &n));
  text[strcspn(text, ",\n\r")] = 0;
  PetscCall(PetscStrncpy(version, text, len));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode VersionsGet(Versions *v)
{
  PetscInt major, minor, subminor;

  PetscFunctionBeginUser;
  *v = (Versions){.tumble = TUMBLE_VERSION, .commit = TUMBLE_COMMIT, .optimised = OPTIMISED};
  PetscCall(PetscGetVersionNumber(&major, &minor, &subminor, NULL));
  PetscCall(PetscSNPrintf(v->petsc, sizeof(v->petsc), "%" PetscInt_FMT ".%" PetscInt_FMT ".%" PetscInt_FMT, major,
                          minor, subminor));
  PetscCall(get_mpi_version(v->mpi, sizeof(v->mpi)));
#if defined(PETSC_PKG_HYPRE_VERSION_MAJOR)
  PetscCall(PetscSNPrintf(v->hypre, sizeof(v->hypre), "%d.%d.%d", PETSC_PKG_HYPRE_VERSION_MAJOR,
                          PETSC_PKG_HYPRE_VERSION_MINOR, PETSC_PKG_HYPRE_VERSION_SUBMINOR));
#endif
#if defined(PETSC_PKG_HDF5_VERSION_MAJOR)
  PetscCall(PetscSNPrintf(v->hdf5, sizeof(v->hdf5), "%d.%d.%d", PETSC_PKG_HDF5_VERSION_MAJOR,
                          PETSC_PKG_HDF5_VERSION_MINOR, PETSC_PKG_HDF5_VERSION_SUBMINOR));
#endif
  PetscFunctionReturn(PETSC_SUCCESS);
}
