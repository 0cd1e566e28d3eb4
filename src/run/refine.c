/* Refine: see refine.h. */
#include "compat.h"
#include "refine.h"
#include "base/log.h"

typedef struct {
  Bodies     bodies;
  BodyState *s;
  PetscInt   dim;
  PetscReal  period[3];
  PetscBool  inside; /* insides count as surface */
} Surface;

/* Smallest distance of x to any body, looked at closely for those within reach only */
static PetscErrorCode measure_distance(void *context, const PetscReal x[3], PetscReal reach, PetscReal *d)
{
  const Surface *s = context;

  PetscFunctionBeginUser;
  *d = PETSC_MAX_REAL;
  for (PetscInt k = 0; k < s->s->n; k++) {
    PetscReal y[3] = {0, 0, 0}, r = 0, at;

    for (PetscInt a = 0; a < s->dim; a++) {
      y[a] = DomainNearest(s->period[a], x[a], s->s->x[k][a]);
      r += PetscSqr(y[a] - s->s->x[k][a]);
    }
    r = PetscSqrtReal(r) - BodiesGetRadius(s->s, k);
    if (r > reach || r > *d) continue;
    PetscCall(BodiesDistance(s->bodies, k, NULL, NULL, 1, y, &at));
    *d = PetscMin(*d, s->inside ? PetscMax(at, 0) : PetscAbsReal(at));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Cells that a surface cuts and that have nodes of a larger cell cost iterations: 11 become 19, 30 become 45 */
static PetscErrorCode remark_cut_jumps(Surface *s, Mesh mesh)
{
  const MeshLocal *l;
  PetscInt         cut = 0;

  PetscFunctionBeginUser;
  PetscCall(MeshGetLocal(mesh, &l));
  for (PetscInt c = 0; c < l->ncell && s->s->n; c++) {
    PetscReal xc[MESH_MAX_NB * 3], centre[3] = {0, 0, 0}, r = 0, d;

    if (!MeshCellHang(l, c)) continue;
    PetscCall(MeshCellCoordinates(mesh, c, xc));
    for (PetscInt a = 0; a < l->dim; a++) {
      centre[a] = xc[(l->nb / 2) * l->dim + a];
      r += PetscSqr(centre[a] - xc[a]);
    }
    r         = PetscSqrtReal(r);
    s->inside = PETSC_FALSE;
    PetscCall(measure_distance(s, centre, r, &d));
    cut += d < r;
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &cut, 1, MPIU_INT, MPI_SUM, PETSC_COMM_WORLD));
  if (cut)
    PetscCall(LogRemark("levels of the mesh jump at %" PetscInt_FMT
                        " cells that a body's surface is in: up to three times the iterations. Raise -mesh_band, or move or enlarge the boxes of "
                        "-mesh_refine",
                        cut));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode RefineCreateMesh(MPI_Comm comm, PetscBool around, Bodies *bodies, Mesh *mesh)
{
  Surface   s = {0};
  PetscReal lower[3], upper[3];
  PetscBool still;

  PetscFunctionBeginUser;
  PetscCall(MeshReadBox(comm, &s.dim, lower, upper, s.period));
  PetscCall(BodiesCreate(s.dim, lower, upper, bodies));
  s.bodies = *bodies;
  PetscCall(BodiesGetState(*bodies, &s.s));
  PetscCall(BodiesAreStill(*bodies, &still));
  PetscCheck(still || !around, comm, PETSC_ERR_SUP,
             "-mesh_refine bodies refines where bodies are at the start, and these move: name a box around their way instead (-mesh_refine <box>, "
             "-mesh_box_<box>_corners)");
  s.inside = (PetscBool)!still;
  PetscCall(MeshCreateAround(comm, s.s->n ? &(MeshSurface){measure_distance, &s} : NULL, mesh));
  PetscCall(remark_cut_jumps(&s, *mesh));
  PetscFunctionReturn(PETSC_SUCCESS);
}
