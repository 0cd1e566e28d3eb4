/* Traction: see traction.h. Faces are those of own cells all of whose nodes are on the boundary. */
#include "compat.h"
#include "impl.h"
#include "base/algebra.h"
#include "fem/side.h"
#include "traction.h"

struct _p_Traction {
  Flow             f;
  const MeshLocal *loc;
  PetscInt         nface, nq;
  PetscInt        *cell, *side, *boundary, *next; /* [nface] side 2 axis + 1: upper end; the cell's next face, -1 */
  PetscInt        *first;                         /* [ncell] first face of a cell, -1: it has none */
  PetscReal       *x, *area;                      /* [nface][nq][dim]: positions, weight times normal */
  PetscReal       *pressure;                      /* [nface][nq] */
  PetscReal       *r;                             /* [nface][nb][dim] in the slots of the cell */
};

/* Count the faces of boundary b, or list them */
static PetscErrorCode find_faces(Traction t, PetscInt b, PetscBool list)
{
  const MeshLocal *l = t->loc;
  const PetscInt  *node;
  PetscInt         n;
  PetscBool       *on;

  PetscFunctionBeginUser;
  PetscCall(MeshGetBoundaryNodes(t->f->mesh, b, &n, &node));
  PetscCall(PetscCalloc1(l->nnode_all, &on));
  for (PetscInt i = 0; i < n; i++) on[node[i]] = PETSC_TRUE;
  for (PetscInt c = 0; c < l->ncell && n; c++) {
    for (PetscInt side = 0; side < 2 * l->dim; side++) {
      if (!SideIsMarked(l->dim, side, l->cell_node + c * l->nb, on)) continue;
      if (list) {
        t->cell[t->nface]     = c;
        t->side[t->nface]     = side;
        t->boundary[t->nface] = b;
        t->next[t->nface]     = t->first[c];
        t->first[c]           = t->nface;
      }
      t->nface++;
    }
  }
  PetscCall(PetscFree(on));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode TractionCreate(Flow f, Traction *traction)
{
  const MeshLocal *l = f->loc;
  PetscInt         nboundary, any = 0;
  Traction         t;

  PetscFunctionBeginUser;
  *traction = NULL;
  PetscCall(MeshGetBoundaryCount(f->mesh, &nboundary));
  for (PetscInt b = 0; b < nboundary; b++) any += ConditionsHasPressure(f->boundary, b);
  if (!any) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscNew(&t));
  t->f   = f;
  t->loc = l;
  t->nq  = l->dim == 2 ? 3 : 9;
  PetscCall(PetscMalloc1(l->ncell, &t->first));
  for (PetscInt c = 0; c < l->ncell; c++) t->first[c] = -1;
  for (PetscInt pass = 0; pass < 2; pass++) {
    t->nface = 0;
    for (PetscInt b = 0; b < nboundary; b++)
      if (ConditionsHasPressure(f->boundary, b)) PetscCall(find_faces(t, b, (PetscBool)(pass == 1)));
    if (pass == 0)
      PetscCall(PetscMalloc4(t->nface, &t->cell, t->nface, &t->side, t->nface, &t->boundary, t->nface, &t->next));
  }
  PetscCall(PetscMalloc4(t->nface * t->nq * l->dim, &t->x, t->nface * t->nq * l->dim, &t->area, t->nface * t->nq,
                         &t->pressure, t->nface * l->nb * l->dim, &t->r));
  PetscCall(PetscArrayzero(t->r, t->nface * l->nb * l->dim));
  *traction = t;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode TractionDestroy(Traction *traction)
{
  Traction t = *traction;

  PetscFunctionBeginUser;
  if (!t) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscFree(t->first));
  PetscCall(PetscFree4(t->cell, t->side, t->boundary, t->next));
  PetscCall(PetscFree4(t->x, t->area, t->pressure, t->r));
  PetscCall(PetscFree(*traction));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Positions and normals of face i; those of a cell that is no part of the fluid are zero */
static PetscErrorCode measure_face(Traction t, PetscInt i)
{
  const PetscInt dim = t->loc->dim, axis = t->side[i] / 2;
  PetscReal      xc[MESH_MAX_NB * 3];

  PetscFunctionBeginUser;
  PetscCall(MeshCellCoordinates(t->f->mesh, t->cell[i], xc));
  for (PetscInt q = 0; q < t->nq; q++) {
    PetscReal       xi[3], J[9], inverse[9], *x = t->x + (i * t->nq + q) * dim, *area = t->area + (i * t->nq + q) * dim;
    const PetscReal weight = SidePoint(dim, t->side[i], q, xi) * (t->side[i] % 2 ? 1 : -1);
    PetscReal       det;

    ElementMap(dim, xc, xi, x, J);
    det = DenseInvertMap(dim, J, inverse);
    for (PetscInt a = 0; a < dim; a++)
      area[a] = FlowIsInactive(t->f, t->cell[i]) ? 0 : weight * det * inverse[axis * dim + a];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* r of face i: -int P n phi_j at the lattice points, then in the slots */
static void integrate_face(Traction t, PetscInt i)
{
  const PetscInt dim = t->loc->dim, nb = t->loc->nb;
  PetscReal     *r = t->r + i * nb * dim;

  for (PetscInt k = 0; k < nb * dim; k++) r[k] = 0;
  for (PetscInt q = 0; q < t->nq; q++) {
    const PetscReal *area = t->area + (i * t->nq + q) * dim;
    PetscReal        xi[3], phi[MESH_MAX_NB], dphi[3 * MESH_MAX_NB];

    (void)SidePoint(dim, t->side[i], q, xi);
    ElementBasis(dim, xi, phi, dphi);
    for (PetscInt j = 0; j < nb; j++)
      for (PetscInt a = 0; a < dim; a++) r[j * dim + a] -= t->pressure[i * t->nq + q] * area[a] * phi[j];
  }
  MeshCellScatter(t->loc, t->cell[i], dim, r);
}

PetscErrorCode TractionEvaluate(Traction t)
{
  const FlowStep *s = &t->f->step;
  PetscInt        nboundary;

  PetscFunctionBeginUser;
  PetscCall(MeshGetBoundaryCount(t->f->mesh, &nboundary));
  for (PetscInt i = 0; i < t->nface; i++) PetscCall(measure_face(t, i));
  for (PetscInt b = 0, start = 0; b < nboundary; b++) {
    PetscInt n = 0;

    if (!ConditionsHasPressure(t->f->boundary, b)) continue;
    while (start + n < t->nface && t->boundary[start + n] == b) n++;
    PetscCall(ConditionsGetPressure(t->f->boundary, b, s->theta, s->dt, n * t->nq, t->x + start * t->nq * t->loc->dim,
                                    t->pressure + start * t->nq));
    start += n;
  }
  for (PetscInt i = 0; i < t->nface; i++) integrate_face(t, i);
  PetscFunctionReturn(PETSC_SUCCESS);
}

void TractionAddCell(Traction t, PetscInt c, PetscReal scale, PetscReal r[])
{
  const PetscInt n = t->loc->nb * t->loc->dim;

  for (PetscInt i = t->first[c]; i >= 0; i = t->next[i])
    for (PetscInt k = 0; k < n; k++) r[k] += scale * t->r[i * n + k];
}

void TractionAdd(Traction t, PetscReal r[])
{
  const PetscInt dim = t->loc->dim, nb = t->loc->nb;

  for (PetscInt i = 0; i < t->nface; i++)
    for (PetscInt k = 0; k < nb * dim; k++)
      r[t->loc->cell_node[t->cell[i] * nb + k / dim] * dim + k % dim] += t->r[i * nb * dim + k];
}

void TractionSum(Traction t, PetscReal force[])
{
  const PetscInt dim = t->loc->dim;

  for (PetscInt k = 0; k < t->nface * t->nq * dim; k++) force[k % dim] -= t->pressure[k / dim] * t->area[k];
}
