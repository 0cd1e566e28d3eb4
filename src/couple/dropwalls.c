/* CoupleDrops, walls: where drops wet walls. The interface ends on plane walls of type slip, within which its last
   vertices move. In the Laplace-Beltrami form the wall pulls with sigma cos(theta) along itself at a contact line, away
   from the drop (Young), theta the angle inside the drop, and nothing else is prescribed there. A wall without friction
   lets contact lines go as fast as the fluids do; with a slip length l it drags with mu u/l (Navier). */
#include "compat.h"
#include "drops.h"
#include "impl.h"
#include "base/algebra.h"
#include "base/face.h"
#include "base/opt.h"
#include "fem/edge.h"
#include "fem/element.h"
#include "fem/side.h"
#include "flow/condition.h"

/* Boundary b of type slip, if it is a side of the box */
static PetscErrorCode add_wall(CoupleDrops *f, Couple c, PetscInt b, PetscInt *sides)
{
  const char     *name;
  const PetscInt *node;
  char            option[OPT_NAME];
  PetscInt        n, on, side = 0;

  PetscFunctionBeginUser;
  PetscCall(MeshGetBoundaryName(c->mesh, b, &name));
  PetscCall(MeshGetBoundaryNodes(c->mesh, b, &n, &node));
  PetscCall(MeshGetBoundarySides(c->mesh, b, &on));
  while (side < 6 && on != 1 << side) side++;
  if (side == 6) PetscFunctionReturn(PETSC_SUCCESS);
  *sides |= on;
  f->wall[side].boundary = b;
  PetscCall(OptReal(OptJoin("-flow_bc_", name, "_navier", option), &f->wall[side].slip_length));
  for (PetscInt i = 0; i < n; i++) f->side[node[i]] |= on;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DropsFindWalls(CoupleDrops *f, Couple c)
{
  PetscInt n, sides = 0;

  PetscFunctionBeginUser;
  if (!DropsWet(f->s)) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(MeshGetBoundaryCount(c->mesh, &n));
  for (PetscInt b = 0; b < n; b++) {
    PetscBool wall, open, sticks, moves;

    PetscCall(ConditionsGetKind(FlowConditions(c->flow), b, &wall, &open));
    PetscCall(ConditionsSticks(FlowConditions(c->flow), b, &sticks, &moves));
    if (wall && !sticks) PetscCall(add_wall(f, c, b, &sides));
  }
  PetscCheck(sides, c->comm, PETSC_ERR_USER_INPUT,
             "-particle_%s_contact_angle: the domain has no plane wall of type slip, on which a contact line could move: give one "
             "-flow_bc_<boundary>_type slip (with a -flow_bc_<boundary>_navier it has friction), or remove the angle",
             f->s->group[0].name);
  PetscCall(PhaseSurfacesSetWalls(f->surfaces, sides));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscInt DropsSideSlots(PetscInt dim, PetscInt e, PetscInt slot[])
{
  if (dim == 2)
    for (PetscInt j = 0; j < 3; j++) slot[j] = ELEMENT_EDGE[e][j];
  else SideList(dim, e, slot);
  return dim == 2 ? 3 : 9;
}

/* The wall that side e of the cell lies on, -1; slots of the side */
static PetscInt wall_of(const CoupleDrops *f, const MeshLocal *l, PetscInt cell, PetscInt e, PetscInt slot[])
{
  const PetscInt n = DropsSideSlots(l->dim, e, slot), middle = l->cell_node[cell * l->nb + slot[n / 2]];

  for (PetscInt side = 0; side < 2 * l->dim; side++)
    if (f->side[middle] == 1 << side && DropsIsBoundary(l, middle)) return side;
  return -1;
}

PetscBool DropsHasFriction(const CoupleDrops *f, const MeshLocal *l, PetscInt cell)
{
  for (PetscInt e = 0; e < 2 * l->dim; e++) {
    PetscInt       slot[SIDE_MAX];
    const PetscInt side = wall_of(f, l, cell, e, slot);

    if (side >= 0 && f->wall[side].slip_length > 0) return PETSC_TRUE;
  }
  return PETSC_FALSE;
}

static void add_edge_friction(PetscReal rate, const PetscInt slot[], const PetscReal xc[], PetscReal M[])
{
  for (PetscInt g = 0; g < EDGE_NGAUSS; g++) {
    PetscReal v[3], dv[3], t[2] = {0, 0};

    ElementLine(EDGE_GAUSS[g], v, dv);
    for (PetscInt j = 0; j < 6; j++) t[j % 2] += dv[j / 2] * xc[2 * slot[j / 2] + j % 2];
    for (PetscInt i = 0; i < 9; i++)
      M[9 * slot[i / 3] + slot[i % 3]] += rate * EDGE_WEIGHT[g] * PetscHypotReal(t[0], t[1]) * v[i / 3] * v[i % 3];
  }
}

/* In space, of a face of 9 nodes */
static void add_face_friction(PetscReal rate, const PetscInt slot[], const PetscReal xc[], PetscReal M[])
{
  PetscReal x[9][3];

  for (PetscInt i = 0; i < 27; i++) x[i / 3][i % 3] = xc[3 * slot[i / 3] + i % 3];
  for (PetscInt q = 0; q < EDGE_NGAUSS * EDGE_NGAUSS; q++) {
    const PetscReal s[2] = {EDGE_GAUSS[q % EDGE_NGAUSS], EDGE_GAUSS[q / EDGE_NGAUSS]};
    PetscReal       v[2][3], dv[3], n[3], w;
    FacePoint       p;

    FaceEvaluate(3, x, s, &p);
    cross(p.t[0], p.t[1], n);
    w = rate * EDGE_WEIGHT[q % EDGE_NGAUSS] * EDGE_WEIGHT[q / EDGE_NGAUSS] * PetscSqrtReal(dot3(n, n));
    for (PetscInt a = 0; a < 2; a++) ElementLine(s[a], v[a], dv);
    for (PetscInt i = 0; i < 81; i++)
      M[27 * slot[i / 9] + slot[i % 9]] += w * v[0][i / 9 % 3] * v[1][i / 27] * v[0][i % 9 % 3] * v[1][i % 9 / 3];
  }
}

/* At the ends of an edge along the wall that lie on the interface */
static void pull_ends(CoupleDrops *f, const MeshLocal *l, const PetscInt node[], const PetscInt slot[], PetscInt side,
                      PetscReal pull)
{
  const PetscInt a = 1 - side / 2;

  for (PetscInt j = 0; j < 3; j += 2) {
    const PetscInt  i    = node[slot[j]];
    const PetscReal away = MeshNearest(l, a, l->x_start[2 * i + a] - l->x_start[2 * node[slot[1]] + a]);
    const PetscReal end  = away > 0 ? pull : -pull;

    if (!DropsIsInterface(l, f->cell_drop, i)) continue;
    f->force[2 * i + a] += end;
    f->wall[side].pull[a] += end;
  }
}

/* In space along the edges of a face on the wall that lie on the interface */
static void pull_edges(CoupleDrops *f, const MeshLocal *l, const PetscInt node[], const PetscInt slot[], PetscInt side,
                       const PetscReal xc[], PetscReal pull)
{
  static const PetscInt ROUND[4][3] = {{0, 1, 2}, {2, 5, 8}, {8, 7, 6}, {6, 3, 0}};
  const PetscReal       normal[3]   = {side / 2 == 0, side / 2 == 1, side / 2 == 2};

  for (PetscInt e = 0; e < 4; e++) {
    if (!DropsIsInterface(l, f->cell_drop, node[slot[ROUND[e][1]]])) continue;
    for (PetscInt g = 0; g < EDGE_NGAUSS; g++) {
      PetscReal v[3], dv[3], t[3] = {0}, out[3] = {0}, across[3], sign;

      ElementLine(EDGE_GAUSS[g], v, dv);
      for (PetscInt j = 0; j < 9; j++) {
        const PetscReal x = xc[3 * slot[ROUND[e][j / 3]] + j % 3];

        t[j % 3] += dv[j / 3] * x;
        out[j % 3] += v[j / 3] * (x - xc[3 * slot[4] + j % 3]);
      }
      cross(t, normal, across); /* of the length of t */
      sign = dot3(across, out) > 0 ? 1 : -1;
      for (PetscInt j = 0; j < 9; j++) {
        const PetscReal part = sign * pull * EDGE_WEIGHT[g] * v[j / 3] * across[j % 3];

        f->force[3 * node[slot[ROUND[e][j / 3]]] + j % 3] += part;
        f->wall[side].pull[j % 3] += part;
      }
    }
  }
}

/* M [nb][nb] += friction of side e of a cell, where it lies on a wall that has some: which, else -1 */
static PetscInt add_friction(const CoupleDrops *f, const MeshLocal *l, PetscInt cell, PetscInt e, const PetscReal xc[],
                             PetscReal M[])
{
  PetscInt       slot[SIDE_MAX];
  const PetscInt side = wall_of(f, l, cell, e, slot);

  if (side < 0 || f->wall[side].slip_length <= 0) return -1;
  (l->dim == 2 ? add_edge_friction : add_face_friction)(f->viscosity[cell] / f->wall[side].slip_length, slot, xc, M);
  return side;
}

void DropsAddFriction(const CoupleDrops *f, const MeshLocal *l, PetscInt cell, const PetscReal xc[], PetscReal M[])
{
  for (PetscInt e = 0; e < 2 * l->dim; e++) add_friction(f, l, cell, e, xc, M);
  MeshCellMatrix(l, cell, 1, l->nb, M); /* the interface has no hanging nodes */
}

void DropsAddPull(CoupleDrops *f, const MeshLocal *l, PetscInt cell, const PetscReal xc[])
{
  const PetscInt  *node = l->cell_node + cell * l->nb;
  const DropGroup *g    = f->s->group + f->s->drop[DropsFind(f->s, f->cell_drop[cell])].group;
  const PetscReal  pull = g->tension * PetscCosReal(g->contact);

  for (PetscInt e = 0; e < 2 * l->dim; e++) {
    PetscInt       slot[SIDE_MAX];
    const PetscInt side = wall_of(f, l, cell, e, slot);

    if (side < 0) continue;
    if (l->dim == 2) pull_ends(f, l, node, slot, side, pull);
    else pull_edges(f, l, node, slot, side, xc, pull);
  }
}

/* force [6][3] += friction of walls on the fluids in an own cell */
static PetscErrorCode sum_friction(const CoupleDrops *f, Couple c, PetscInt cell, const PetscReal u[],
                                   PetscReal (*force)[3])
{
  const MeshLocal *l   = c->loc;
  const PetscInt   dim = l->dim, nb = l->nb;
  PetscReal        xc[3 * MESH_MAX_NB], v[3 * MESH_MAX_NB];

  PetscFunctionBeginUser;
  PetscCall(MeshCellCoordinates(c->mesh, cell, xc));
  MeshCellValues(l, cell, dim, u, v);
  for (PetscInt e = 0; e < 2 * dim; e++) {
    PetscReal      M[MESH_MAX_NB * MESH_MAX_NB] = {0};
    const PetscInt side                         = add_friction(f, l, cell, e, xc, M);

    for (PetscInt i = 0; i < nb * nb && side >= 0; i++)
      for (PetscInt a = 0; a < dim; a++) force[side][a] -= M[i] * v[dim * (i % nb) + a];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DropsBalanceWalls(const CoupleDrops *f, Couple c, const PetscReal u[], PetscReal sum[3])
{
  const MeshLocal *l           = c->loc;
  PetscReal        force[6][3] = {{0}};

  PetscFunctionBeginUser;
  sum[0] = sum[1] = sum[2] = 0;
  if (!DropsWet(f->s)) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt side = 0; side < 6; side++) PetscCall(PetscArraycpy(force[side], f->wall[side].pull, 3));
  for (PetscInt e = 0; e < l->ncell; e++)
    if (DropsHasFriction(f, l, e)) PetscCall(sum_friction(f, c, e, u, force));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, force, 18, MPIU_REAL, MPIU_SUM, c->comm));
  for (PetscInt side = 0; side < 6; side++) {
    PetscReal on_wall[3];

    for (PetscInt a = 0; a < 3; a++) {
      sum[a] += force[side][a];
      on_wall[a] = -force[side][a];
    }
    PetscCall(CoupleAddWallForce(c, f->wall[side].boundary, on_wall));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}
