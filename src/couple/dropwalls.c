/* CoupleDrops, walls: where drops wet walls. The interface ends on plane walls of type slip, within which its last
   vertices move. In the Laplace-Beltrami form the wall pulls with sigma cos(theta) along itself at a contact line, away
   from the drop (Young), theta the angle inside the drop, and nothing else is prescribed there. A wall without friction
   lets contact lines go as fast as the fluids do; with a slip length l it drags with mu u/l (Navier). */
#include "compat.h"
#include "drops.h"
#include "impl.h"
#include "base/opt.h"
#include "fem/edge.h"
#include "fem/element.h"
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
  while (side < 4 && on != 1 << side) side++;
  if (side == 4) PetscFunctionReturn(PETSC_SUCCESS);
  *sides |= on;
  PetscCall(OptReal(OptJoin("-flow_bc_", name, "_navier", option), &f->slip_length[side]));
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

/* The wall that edge e of the cell lies on, -1 */
static PetscInt wall_of(const CoupleDrops *f, const MeshLocal *l, const PetscInt node[], PetscInt e)
{
  const PetscInt middle = node[ELEMENT_EDGE[e][1]];

  for (PetscInt side = 0; side < 4; side++)
    if (f->side[middle] == 1 << side && DropsIsBoundary(l, middle)) return side;
  return -1;
}

PetscBool DropsHasFriction(const CoupleDrops *f, const MeshLocal *l, PetscInt cell)
{
  for (PetscInt e = 0; e < 4; e++) {
    const PetscInt side = wall_of(f, l, l->cell_node + cell * l->nb, e);

    if (side >= 0 && f->slip_length[side] > 0) return PETSC_TRUE;
  }
  return PETSC_FALSE;
}

static void add_friction(PetscReal rate, const PetscInt slot[3], const PetscReal xc[], PetscReal M[])
{
  for (PetscInt g = 0; g < EDGE_NGAUSS; g++) {
    PetscReal v[3], dv[3], t[2] = {0, 0};

    ElementLine(EDGE_GAUSS[g], v, dv);
    for (PetscInt j = 0; j < 6; j++) t[j % 2] += dv[j / 2] * xc[2 * slot[j / 2] + j % 2];
    for (PetscInt i = 0; i < 9; i++)
      M[9 * slot[i / 3] + slot[i % 3]] += rate * EDGE_WEIGHT[g] * PetscHypotReal(t[0], t[1]) * v[i / 3] * v[i % 3];
  }
}

/* At the ends of an edge along the wall that lie on the interface */
static void add_pull(CoupleDrops *f, const MeshLocal *l, PetscInt cell, PetscInt e, PetscInt side)
{
  const PetscInt  *node = l->cell_node + cell * l->nb, *slot = ELEMENT_EDGE[e], a = 1 - side / 2;
  const DropGroup *g = f->s->group + f->s->drop[DropsFind(f->s, f->cell_drop[cell])].group;

  for (PetscInt j = 0; j < 3; j += 2) {
    const PetscInt  i    = node[slot[j]];
    const PetscReal away = MeshNearest(l, a, l->x_start[2 * i + a] - l->x_start[2 * node[slot[1]] + a]);

    if (!DropsIsInterface(l, f->cell_drop, i)) continue;
    f->force[2 * i + a] += (away > 0 ? 1 : -1) * g->tension * PetscCosReal(g->contact);
  }
}

void DropsAddFriction(const CoupleDrops *f, const MeshLocal *l, PetscInt cell, const PetscReal xc[], PetscReal M[])
{
  for (PetscInt e = 0; e < 4; e++) {
    const PetscInt side = wall_of(f, l, l->cell_node + cell * l->nb, e);

    if (side >= 0 && f->slip_length[side] > 0)
      add_friction(f->viscosity[cell] / f->slip_length[side], ELEMENT_EDGE[e], xc, M);
  }
}

void DropsAddPull(CoupleDrops *f, const MeshLocal *l, PetscInt cell)
{
  for (PetscInt e = 0; e < 4; e++) {
    const PetscInt side = wall_of(f, l, l->cell_node + cell * l->nb, e);

    if (side >= 0) add_pull(f, l, cell, e, side);
  }
}

PetscErrorCode DropsBalanceWalls(const CoupleDrops *f, Couple c, const PetscReal u[], PetscReal sum[3])
{
  const MeshLocal     *l = c->loc;
  const unsigned char *fixed;

  PetscFunctionBeginUser;
  sum[0] = sum[1] = sum[2] = 0;
  if (!DropsWet(f->s)) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(ConditionsGetValues(FlowConditions(c->flow), &fixed, NULL));
  for (PetscInt i = 0; i < 2 * l->nnode_all; i++)
    if (!(fixed[i / 2] >> i % 2 & 1)) sum[i % 2] += f->force[i];
  for (PetscInt t = 0; t < f->nterm; t++) {
    const PetscInt *node = l->cell_node + f->term_cell[t] * l->nb;

    for (PetscInt i = 0; i < 18 && f->term_cell[t] < l->ncell; i++)
      for (PetscInt j = 0; j < 9 && !(fixed[node[i / 2]] >> i % 2 & 1); j++)
        sum[i % 2] -= f->term[81 * t + 9 * (i / 2) + j] * u[2 * node[j] + i % 2];
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 2, MPIU_REAL, MPIU_SUM, c->comm));
  PetscFunctionReturn(PETSC_SUCCESS);
}
