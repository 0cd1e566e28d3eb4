/* Mesh, faces: the geometry of boundaries, see mesh.h. */
#include "compat.h"
#include "impl.h"
#include "fem/side.h"

#define FLAT 1e-10 /* extent of a boundary along an axis by that of the mesh: a plane */

/* The face's middle node lies on no other boundary */
static PetscErrorCode mark_nodes(Mesh m, PetscInt boundary[])
{
  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < m->loc.nnode_all; i++) boundary[i] = -1;
  for (PetscInt b = 0; b < m->nboundary; b++)
    for (PetscInt i = 0; i < m->boundary_count[b]; i++) boundary[m->boundary_node[b][i]] = b;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static void fill_face(Mesh m, PetscInt c, const PetscInt slot[], const PetscReal xc[], PetscInt boundary, BorderFace *f)
{
  const MeshLocal *l = &m->loc;

  *f = (BorderFace){.boundary = boundary};
  for (PetscInt a = 0; a < l->dim; a++) f->inside[a] = xc[l->nb / 2 * l->dim + a];
  for (PetscInt i = 0; i < (l->dim == 2 ? 3 : 9); i++) {
    f->node[i] = l->node_global[l->cell_node[c * l->nb + slot[i]]];
    for (PetscInt a = 0; a < l->dim; a++) f->x[i][a] = xc[slot[i] * l->dim + a];
  }
}

PetscErrorCode MeshGetBoundaryFaces(Mesh m, PetscInt *n, BorderFace *face[])
{
  const MeshLocal *l   = &m->loc;
  const PetscInt   mid = l->dim == 2 ? 1 : 4;
  PetscInt        *boundary;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(l->nnode_all, &boundary));
  PetscCall(mark_nodes(m, boundary));
  for (PetscInt pass = 0; pass < 2; pass++) {
    *n = 0;
    for (PetscInt c = 0; c < l->ncell; c++)
      for (PetscInt side = 0; side < 2 * l->dim; side++) {
        PetscReal xc[MESH_MAX_NB * 3];
        PetscInt  slot[BORDER_NODES], b;

        SideList(l->dim, side, slot);
        b = boundary[l->cell_node[c * l->nb + slot[mid]]];
        if (b < 0) continue;
        if (pass) PetscCall(MeshCellCoordinates(m, c, xc));
        if (pass) fill_face(m, c, slot, xc, b, &(*face)[*n]);
        (*n)++;
      }
    if (!pass) PetscCall(PetscMalloc1(*n, face));
  }
  PetscCall(PetscFree(boundary));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshGetBoundaryRound(Mesh m, PetscInt b, PetscBool *round, BorderRound *r)
{
  PetscFunctionBeginUser;
  PetscCall(MeshKindGetRound(m->kind, b, round, r));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshHasSides(Mesh m, PetscBool *has)
{
  PetscFunctionBeginUser;
  PetscCall(MeshKindHasSides(m->kind, has));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshDescribeBoundary(Mesh m, PetscInt b, char text[], size_t size)
{
  const MeshLocal *l = &m->loc;
  PetscReal        box[6];
  PetscBool        round;
  BorderRound      r;
  size_t           used = 0;

  PetscFunctionBeginUser;
  PetscCall(MeshGetBoundaryRound(m, b, &round, &r));
  if (round) {
    used = (size_t)snprintf(text, size, "%s of radius %g about %g,%g",
                            r.axis >= 0   ? "cylinder"
                            : l->dim == 2 ? "circle"
                                          : "sphere",
                            (double)r.radius, (double)r.centre[0], (double)r.centre[1]);
    if (l->dim == 3 && r.axis < 0 && used < size) (void)snprintf(text + used, size - used, ",%g", (double)r.centre[2]);
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  for (PetscInt e = 0; e < 6; e++) box[e] = PETSC_MAX_REAL; /* lowest, and minus the highest */
  for (PetscInt i = 0; i < m->boundary_count[b]; i++)
    for (PetscInt a = 0; a < l->dim; a++) {
      box[a]     = PetscMin(box[a], l->x[m->boundary_node[b][i] * l->dim + a]);
      box[3 + a] = PetscMin(box[3 + a], -l->x[m->boundary_node[b][i] * l->dim + a]);
    }
  PetscCallMPI(MPI_Allreduce(MPI_IN_PLACE, box, 6, MPIU_REAL, MPIU_MIN, m->comm));
  for (PetscInt a = 0; a < l->dim; a++)
    if (-box[3 + a] - box[a] < FLAT * (l->upper[a] - l->lower[a])) {
      (void)snprintf(text, size, "%c = %g", (char)('x' + a), (double)box[a]);
      PetscFunctionReturn(PETSC_SUCCESS);
    }
  for (PetscInt a = 0; a < l->dim && used < size; a++)
    used += (size_t)snprintf(text + used, size - used, "%s%c from %g to %g", a ? ", " : "", (char)('x' + a),
                             (double)box[a], (double)-box[3 + a]);
  PetscFunctionReturn(PETSC_SUCCESS);
}
