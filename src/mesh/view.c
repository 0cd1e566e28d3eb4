/* Mesh: what it says of itself. */
#include "compat.h"
#include "impl.h"
#include "tree/leaves.h"

PetscErrorCode MeshView(Mesh m, PetscViewer viewer)
{
  const MeshLocal *l = &m->loc;

  PetscFunctionBeginUser;
  PetscCall(PetscViewerASCIIPrintf(viewer,
                                   "mesh: %" PetscInt_FMT "D, %" PetscInt_FMT " cells, %" PetscInt_FMT
                                   " Q2 nodes, smallest cell size %g, box",
                                   l->dim, l->ncell_global, l->nnode_global, (double)l->h));
  for (PetscInt d = 0; d < l->dim; d++)
    PetscCall(PetscViewerASCIIPrintf(viewer, "%s [%g, %g]", d ? " x" : "", (double)l->lower[d], (double)l->upper[d]));
  PetscCall(PetscViewerASCIIPrintf(viewer, "\n"));
  for (PetscInt i = 0; i <= m->levels && m->level_count; i++) {
    PetscCall(PetscViewerASCIIPrintf(viewer, "%s%" PetscInt_FMT, i ? ", " : "  cells by level: ", m->level_count[i]));
    if (i == m->levels) PetscCall(PetscViewerASCIIPrintf(viewer, "; %" PetscInt_FMT " hanging nodes\n", m->hanging));
  }
  if (m->leaves && m->leaves->boxes.carried)
    PetscCall(PetscViewerASCIIPrintf(viewer, "  fine boxes that go with bodies: %" PetscInt_FMT "\n",
                                     m->leaves->boxes.carried));
  PetscCall(PetscViewerASCIIPrintf(viewer, "  boundaries:"));
  for (PetscInt b = 0; b < m->nboundary; b++) {
    char where[256];

    PetscCall(MeshDescribeBoundary(m, b, where, sizeof(where)));
    PetscCall(PetscViewerASCIIPrintf(viewer, "%s %s (%s)", b ? "," : "", m->boundary_name[b], where));
  }
  for (PetscInt d = 0; d < l->dim; d++)
    if (l->period[d] > 0) PetscCall(PetscViewerASCIIPrintf(viewer, " (periodic %c)", (char)('x' + d)));
  PetscCall(PetscViewerASCIIPrintf(viewer, "\n"));
  PetscFunctionReturn(PETSC_SUCCESS);
}
