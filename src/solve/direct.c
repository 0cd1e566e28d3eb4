/* FlowSolver, direct: a direct solver that runs out of its work space gets more and tries again. MUMPS foresees the
   space in its analysis and adds ICNTL(14) per cent; where pivots are put off, or many ranks have few rows each, that
   is not enough (INFOG(1) = -8, -9; PETSc says DIVERGED_PC_FAILED). */
#include "compat.h"
#include "impl.h"
#include "base/log.h"

#define MAX_SPACE 3200 /* per cent */

/* MUMPS's matrix behind the outer iterations, its error and its space in per cent; NULL: another solver */
static PetscErrorCode find_mumps(KSP ksp, Mat *factor, PetscInt *error, PetscInt *space)
{
  PC            pc;
  MatSolverType type;
  PetscBool     lu, mumps;

  PetscFunctionBeginUser;
  *factor = NULL;
  *error  = 0;
  *space  = 0;
  PetscCall(KSPGetPC(ksp, &pc));
  PetscCall(PetscObjectTypeCompare((PetscObject)pc, PCLU, &lu));
  if (!lu) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PCFactorGetMatSolverType(pc, &type));
  PetscCall(PetscStrcmp(type, MATSOLVERMUMPS, &mumps));
  if (!mumps) PetscFunctionReturn(PETSC_SUCCESS);
#if defined(PETSC_HAVE_MUMPS)
  PetscCall(PCFactorGetMatrix(pc, factor));
  PetscCall(MatMumpsGetInfog(*factor, 1, error));
  PetscCall(MatMumpsGetIcntl(*factor, 14, space));
#endif
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* After an error MUMPS wants its analysis again: all anew, with other options */
static PetscErrorCode give_space(KSP ksp, PetscInt space)
{
  char        text[16], name[64];
  const char *prefix;
  Mat         A, P;
  PC          pc;

  PetscFunctionBeginUser;
  PetscCall(KSPGetOptionsPrefix(ksp, &prefix));
  PetscCall(PetscSNPrintf(name, sizeof(name), "-%smat_mumps_icntl_14", prefix ? prefix : ""));
  PetscCall(PetscSNPrintf(text, sizeof(text), "%" PetscInt_FMT, space));
  PetscCall(PetscOptionsSetValue(NULL, name, text));
  PetscCall(KSPGetPC(ksp, &pc));
  PetscCall(KSPGetOperators(ksp, &A, &P));
  PetscCall(PetscObjectReference((PetscObject)A));
  PetscCall(PetscObjectReference((PetscObject)P));
  PetscCall(PCReset(pc));
  PetscCall(KSPSetOperators(ksp, A, P));
  PetscCall(MatDestroy(&A));
  PetscCall(MatDestroy(&P));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverIterate(FlowSolver fs, Vec b, Vec x)
{
  KSPConvergedReason reason;
  PetscInt           error, space, more;
  Mat                factor;

  PetscFunctionBeginUser;
  while (PETSC_TRUE) {
    PetscCall(KSPSolve(fs->ksp, b, x));
    PetscCall(KSPGetConvergedReason(fs->ksp, &reason));
    if (reason != KSP_DIVERGED_PC_FAILED) break;
    PetscCall(find_mumps(fs->ksp, &factor, &error, &space));
    if (!factor) break;
    PetscCheck(error != -13, fs->comm, PETSC_ERR_MEM,
               "MUMPS found no memory for its factors (INFOG(1) = -13): use -flow_solver balanced");
    if (error != -8 && error != -9) break;
    PetscCheck(space < MAX_SPACE, fs->comm, PETSC_ERR_MEM,
               "MUMPS ran out of work space (INFOG(1) = %" PetscInt_FMT ") with -flow_mat_mumps_icntl_14 %" PetscInt_FMT
               ": raise it, or use -flow_solver balanced",
               error, space);
    more = PetscMax(100, 2 * space);
    PetscCall(give_space(fs->ksp, more));
    PetscCall(LogRemark("MUMPS ran out of work space (INFOG(1) = %" PetscInt_FMT
                        ") with -flow_mat_mumps_icntl_14 %" PetscInt_FMT ": goes on with %" PetscInt_FMT,
                        error, space, more));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}
