/* CoupleDrops, sheet: the interface in space (drops.h), the faces of a drop's cells next to the fluid around. */
#include "compat.h"
#include "drops.h"
#include "impl.h"
#include "base/algebra.h"
#include "base/array.h"
#include "base/face.h"
#include "fem/element.h"
#include "fem/gauss.h"
#include "fem/side.h"

/* The face at these slots of a cell with these nodes */
static void fill_face(const MeshLocal *l, const PetscInt slot[], const PetscInt node[], const PetscReal xc[],
                      PhaseFace *face)
{
  for (PetscInt j = 0; j < 9; j++)
    for (PetscInt a = 0; a < 3; a++) {
      face->key[j][a] = l->x_start[3 * node[slot[j]] + a];
      face->x[j][a]   = xc[3 * slot[j] + a];
    }
}

PetscErrorCode DropsGatherSheet(CoupleDrops *f, Couple c, const PetscInt cell_drop[], const PetscReal way[],
                                PhaseSheet *sheet)
{
  const MeshLocal *l = c->loc;
  PetscInt         n = 0, capacity = 0;
  PhaseFace       *face = NULL;

  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < l->ncell; e++) {
    const PetscInt *node = l->cell_node + e * l->nb;
    PetscReal       xc[3 * MESH_MAX_NB];

    if (cell_drop[e] < 0) continue;
    PetscCall(DropsCellCoordinates(f, c, e, way, xc));
    for (PetscInt side = 0; side < 6; side++) {
      PetscInt  slot[SIDE_MAX];
      PetscBool wall;

      SideListOutward(side, slot);
      wall = DropsIsBoundary(l, node[slot[4]]);
      if (!wall && !DropsIsInterface(l, cell_drop, node[slot[4]])) continue;
      PetscCall(ArrayReserve(n + 1, &capacity, &face, sizeof(*face), NULL));
      fill_face(l, slot, node, xc, face + n);
      face[n].wall   = wall ? 1 : 0;
      face[n++].drop = (PetscReal)cell_drop[e];
    }
  }
  PetscCall(PhaseSheetGather(c->comm, n, face, l->period, sheet));
  PetscCall(PetscFree(face));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* grad_s phi_i . grad_s phi_j = d phi_i^T g^-1 d phi_j, g the metric of the tangents */
void DropsFaceMatrix(PetscReal sigma, PetscReal x[9][3], PetscReal K[9][9])
{
  for (PetscInt i = 0; i < 81; i++) K[i / 9][i % 9] = 0;
  for (PetscInt q = 0; q < 16; q++) {
    const PetscReal st[2] = {GAUSS4_POINT[q % 4], GAUSS4_POINT[q / 4]};
    PetscReal       v[2][3], d[2][3], g[3], det, w, dphi[9][2];
    FacePoint       p;

    FaceEvaluate(3, x, st, &p);
    for (PetscInt e = 0; e < 2; e++) ElementLine(st[e], v[e], d[e]);
    for (PetscInt i = 0; i < 9; i++) {
      dphi[i][0] = d[0][i % 3] * v[1][i / 3];
      dphi[i][1] = v[0][i % 3] * d[1][i / 3];
    }
    g[0] = dot3(p.t[0], p.t[0]);
    g[1] = dot3(p.t[0], p.t[1]);
    g[2] = dot3(p.t[1], p.t[1]);
    det  = g[0] * g[2] - g[1] * g[1];
    if (det <= 0) continue;
    w = sigma * GAUSS4_WEIGHT[q % 4] * GAUSS4_WEIGHT[q / 4] / PetscSqrtReal(det);
    for (PetscInt i = 0; i < 9; i++)
      for (PetscInt j = 0; j < 9; j++)
        K[i][j] += w * (g[2] * dphi[i][0] * dphi[j][0] + g[0] * dphi[i][1] * dphi[j][1] -
                        g[1] * (dphi[i][0] * dphi[j][1] + dphi[i][1] * dphi[j][0]));
  }
}
